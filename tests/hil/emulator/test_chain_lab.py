"""The emulator with a chain of robots."""

from __future__ import annotations

import numpy as np
import pytest

from hil.emulator.node import EmulatorNode
from hil.lockstep.lockstep import EPOCH_NS
from hil.nodes.node import Outgoing, diagnostics
from hil.scenario.files import load_scenario
from hil.scenario.links import links_of
from hil.wire import message_types as msg
from hil.wire import topics
from hil.wire.events import TICK, Event
from hil.wire.messages import decode_as, encode, header

SCENARIO = load_scenario("chain5-turtlebot3", ["chain.agents=3"])
NODE = EmulatorNode(SCENARIO)
FOLLOWERS = [link.follower for link in links_of(SCENARIO)]
MS = 1_000_000


def command(robot: str, v: float) -> Event:
    twist = msg.Twist(linear=msg.Vector3(x=v, y=0.0, z=0.0), angular=msg.Vector3(x=0.0, y=0.0, z=0.0))
    return Event(f"{robot}/cmd_vel", encode(msg.TwistStamped(header=header(EPOCH_NS, ""), twist=twist)))


def report(name: str) -> Event:
    return Event(topics.DIAGNOSTICS, encode(diagnostics(name, EPOCH_NS, "", {})))


READY = [
    *(report(f"{daemon}/{name}") for daemon in ("estimator", "controller") for name in FOLLOWERS),
    *(command(name, 0.0) for name in FOLLOWERS),
]


def after(events: list[Event], until_ms: int) -> tuple[int | None, list[Outgoing]]:
    """When the leader set off, and what was sent by a time, the events happening at 10 ms."""
    state = NODE.begin(EPOCH_NS)
    sent: list[Outgoing] = []
    for event in events:
        state, out = NODE.step(state, event, EPOCH_NS + 10 * MS)
        sent.extend(out)
    state, out = NODE.step(state, TICK, EPOCH_NS + until_ms * MS)
    return state.motion_since_ns, [*sent, *out]


@pytest.mark.parametrize("missing", range(len(READY)))
def test_the_leader_waits_for_every_follower(missing: int) -> None:
    assert after(READY, 100)[0] is not None
    assert after([event for place, event in enumerate(READY) if place != missing], 100)[0] is None


def test_frames_show_all_robots_and_each_pair_has_a_truth_of_its_own() -> None:
    _, sent = after([*READY, command("agent3", 0.2)], 500)
    frames = [decode_as(m.payload, msg.RigidBodies) for m in sent if m.topic == topics.RIGID_BODIES]
    assert [body.rigid_body_name for body in frames[-1].rigidbodies] == ["leader", "follower", "agent3"]
    first, second = (
        [decode_as(m.payload, msg.Truth) for m in sent if m.topic == f"{name}/truth"] for name in FOLLOWERS
    )
    assert len(first) == len(second) > 50
    for before, behind in zip(first, second, strict=True):
        assert (before.follower_x, before.follower_y, before.v2) == (
            behind.leader_x,
            behind.leader_y,
            behind.v1,
        )
    assert (first[-1].v1, first[-1].v2, second[-1].v2) == pytest.approx((0.08, 0.0, 0.2), abs=2e-3)


def test_the_noise_of_one_robot_is_not_that_of_another() -> None:
    # A chain moves only once driven: at rest odometry is exact.
    _, sent = after([*READY, command("follower", 0.1), command("agent3", 0.1)], 20_000)
    names = ("leader", "follower", "agent3")
    told = [
        np.array(
            [
                decode_as(m.payload, msg.Odometry).twist.twist.linear.x
                for m in sent
                if m.topic == f"{name}/odom"
            ]
        )
        for name in names
    ]
    noise = np.array([each[100:] - np.mean(each[100:]) for each in told])
    assert np.max(np.abs(np.corrcoef(noise) - np.eye(3))) < 5.0 / np.sqrt(noise.shape[1])
