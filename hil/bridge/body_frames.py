"""Frames of any motion capture as ``RigidBodies``: the bodies by the scenario's names, by its axes."""

from __future__ import annotations

from collections.abc import Sequence

from hil.bridge.seen_frame import SeenBody, SeenFrame, Up, place_of
from hil.scenario.lab import SourceSection
from hil.wire import message_types as msg
from hil.wire.messages import header
from hil.wire.pose_sources import laid, pose_of, upright

FRAME_ID = "mocap"


def known_as(bodies: Sequence[SeenBody], wanted: Sequence[str]) -> list[str]:
    """What each body is called: its name, or its streaming id where that is what is wanted.

    An id counts for a wanted body only if none has it as its name.
    """
    names = {body.name for body in bodies}
    return [
        body.id if body.id in wanted and body.id not in names and body.name not in wanted else body.name
        for body in bodies
    ]


def frame_message(
    frame: SeenFrame, names: Sequence[str], given: Up, source: SourceSection
) -> msg.RigidBodies:
    """The frame under its capture time, with those of its bodies that were seen.

    One without an orientation gets zeros for it. ``names``: of all its bodies. ``given``: which axis points
    up; ``source``: the axes and the unit that whoever hears the message expects.
    """
    bodies = [
        msg.RigidBody(name, [], pose_of(laid(upright(place_of(body), given, 1.0), source.up, source.scale)))
        for name, body in zip(names, frame.bodies, strict=True)
        if body.placed
    ]
    return msg.RigidBodies(header(frame.capture_ns, FRAME_ID), frame.number % 2**32, bodies)
