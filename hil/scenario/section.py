"""What all sections of a scenario are made of: kinds of values, and the base of a section."""

from __future__ import annotations

import math
from typing import Annotated

from msgspec import Meta, Struct

Distance = Annotated[float, Meta(ge=1e-3, le=1e3)]
"""Between two robots [m]."""
Coordinate = Annotated[float, Meta(ge=-1e4, le=1e4)]
"""Of a robot [m]; what is farther off is refused off the wire too."""
Angle = Annotated[float, Meta(ge=-100.0, le=100.0)]
Speed = Annotated[float, Meta(ge=0.0, le=100.0)]
Velocity = Annotated[float, Meta(ge=-100.0, le=100.0)]
"""A speed [m/s] with the direction of driving."""
SpeedLimit = Annotated[float, Meta(ge=1e-4, le=1e3)]
TurnRate = Annotated[float, Meta(ge=-1e3, le=1e3)]
TurnLimit = Annotated[float, Meta(ge=1e-4, le=1e3)]
Acceleration = Annotated[float, Meta(ge=0.0, le=1e4)]
"""Of speed [m/s^2] or of turn rate [rad/s^2], 0 for none that is known."""
Gain = Annotated[float, Meta(ge=1e-6, le=1e4)]
Frequency = Annotated[float, Meta(ge=1e-6, le=1e4)]
Rate = Annotated[float, Meta(ge=0.01, le=10_000.0)]
Duration = Annotated[float, Meta(ge=1e-6, le=1e7)]
SourceTime = Annotated[float, Meta(ge=0.0, le=9e9)]
"""A time [s] that may count from 1970, as recordings do."""
Moment = Annotated[float, Meta(ge=0.0, le=1e7)]
"""A time [s] since something began."""
Patience = Annotated[float, Meta(ge=1e-3, le=100.0)]
"""How long [s] something is waited for or relied on."""
Span = Annotated[float, Meta(ge=0.0, le=1e5)]
"""A delay [s], or by how much clocks differ."""
Lag = Annotated[float, Meta(ge=0.0, le=100.0)]
"""How long [s] a robot takes to follow."""
Deviation = Annotated[float, Meta(ge=1e-6, le=1e3)]
"""A standard deviation that something divides by."""
Noise = Annotated[float, Meta(ge=0.0, le=1e3)]
"""A standard deviation that may be 0."""
Resolution = Annotated[float, Meta(ge=0.0, le=10.0)]
Factor = Annotated[float, Meta(ge=1e-3, le=1e3)]
"""What is told, or a unit, as a multiple of what is true."""
Share = Annotated[float, Meta(ge=0.0, le=10.0)]
Probability = Annotated[float, Meta(ge=0.0, lt=1.0)]
Name = Annotated[str, Meta(pattern=r"^[A-Za-z][A-Za-z0-9_]*$")]
BodyName = Annotated[str, Meta(min_length=1, max_length=200)] | Annotated[int, Meta(ge=0, le=2**63 - 1)]
Namespace = Annotated[str, Meta(pattern=r"^([A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*)?$")]
PoseTriple = tuple[Coordinate, Coordinate, Angle]
Offset = Annotated[float, Meta(ge=-2.0, le=2.0)]
Yaw = Annotated[float, Meta(ge=-math.pi, le=math.pi)]
MountTriple = tuple[Offset, Offset, Yaw]


class Section(Struct, frozen=True, forbid_unknown_fields=True):
    """Base of all sections: immutable, and an unknown key is an error."""
