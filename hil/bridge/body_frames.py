"""Frames of any motion capture as ``RigidBodies``: the bodies by the scenario's names, by its axes."""

from __future__ import annotations

from collections.abc import Sequence

from hil.bridge.seen_frame import SeenBody, SeenFrame
from hil.bridge.up_axis import Up, turned_orientation, turned_position
from hil.nodes.node import Outgoing, outgoing
from hil.wire import message_types as msg
from hil.wire import topics
from hil.wire.messages import header

FRAME_ID = "mocap"
_NO_ORIENTATION = (0.0, 0.0, 0.0, 0.0)


def known_as(bodies: Sequence[SeenBody], wanted: Sequence[str]) -> list[str]:
    """What each body is called: its name, or its streaming id where that is what is wanted.

    An id counts for a wanted body only if none has it as its name.
    """
    names = {body.name for body in bodies}
    return [
        body.id if body.id in wanted and body.id not in names and body.name not in wanted else body.name
        for body in bodies
    ]


def frame_message(frame: SeenFrame, names: Sequence[str], given: Up, wanted: Up) -> Outgoing:
    """The frame under its capture time, with those of its bodies that were seen.

    One without an orientation gets zeros for it. ``names``: of all its bodies. ``given``,
    ``wanted``: which axis points up before and after.
    """
    bodies = [
        msg.RigidBody(name, [], _pose(body, given, wanted))
        for name, body in zip(names, frame.bodies, strict=True)
        if body.placed
    ]
    number = frame.number % 2**32
    message = msg.RigidBodies(header(frame.capture_ns, FRAME_ID), number, bodies)
    return outgoing(topics.RIGID_BODIES, message, frame.capture_ns)


def _pose(body: SeenBody, given: Up, wanted: Up) -> msg.Pose:
    x, y, z = turned_position(body.position, given, wanted)
    orientation = body.orientation if body.turned else _NO_ORIENTATION
    qx, qy, qz, qw = turned_orientation(orientation, given, wanted)
    return msg.Pose(position=msg.Point(x=x, y=y, z=z), orientation=msg.Quaternion(x=qx, y=qy, z=qz, w=qw))
