"""Its messages, by name only."""

from named_type import named_type  # type: ignore[import-not-found]

RigidBodies = named_type("mocap4r2_msgs", "RigidBodies")
