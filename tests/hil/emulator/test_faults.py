from __future__ import annotations

import math
from itertools import pairwise

import pytest

from formation.pose import Pose
from formation.records import load
from hil.emulator.faults import Fault, Pair, fault_rows, faulty, is_active
from hil.emulator.node import EmulatorNode
from hil.errors import UsageError
from hil.lockstep.run import run_lockstep
from hil.log.reader import read_log
from hil.scenario.emulated import FaultSection
from hil.scenario.files import load_scenario
from hil.wire import message_types as msg
from hil.wire import topics
from hil.wire.messages import decode_as, to_ns

PERIOD = 0.01
PAIR = Pair(Pose(1.0, 2.0, 0.5), Pose(-1.0, 0.0, 3.0))
LAST = Pair(Pose(0.9, 2.0, 0.4), Pose(-1.1, 0.0, 2.9))


def shown(*faults: FaultSection, t: float = 1.0) -> Pair | None:
    frame = faulty(fault_rows(faults), t, PERIOD, PAIR, LAST)
    return None if frame.lost else frame.pair


def fault(at: float, duration: float = 0.0) -> Fault:
    return load(Fault, fault_rows([FaultSection(kind="swap", at_s=at, duration_s=duration)]), 0)


def test_each_fault_does_what_its_name_says() -> None:
    assert shown() == PAIR
    assert shown(FaultSection(kind="dropout", at_s=1.0)) is None
    assert shown(FaultSection(kind="swap", at_s=1.0)) == Pair(PAIR.follower, PAIR.leader)
    assert shown(FaultSection(kind="freeze", at_s=1.0, body="both")) == LAST
    assert shown(FaultSection(kind="freeze", at_s=1.0)) == Pair(LAST.leader, PAIR.follower)
    stepped = shown(FaultSection(kind="step", at_s=1.0, body="follower", offset=(0.1, -0.2)))
    assert stepped == Pair(PAIR.leader, Pose(-0.9, -0.2, 3.0))
    turned = shown(FaultSection(kind="turn", at_s=1.0, body="follower"))
    assert turned is not None
    assert turned.follower.theta == pytest.approx(3.0 - math.pi)
    assert turned.leader == PAIR.leader


def test_faults_of_one_moment_add_up_in_their_order() -> None:
    swap = FaultSection(kind="swap", at_s=1.0)
    step = FaultSection(kind="step", at_s=1.0, offset=(1.0, 0.0))
    first, then = shown(swap, step), shown(step, swap)
    assert first is not None
    assert then is not None
    assert first.leader.x == PAIR.follower.x + 1.0
    assert then.follower.x == PAIR.leader.x + 1.0


@pytest.mark.parametrize("at", [0.0, 0.003, 0.5, 0.999])
def test_without_duration_it_is_one_frame_and_with_one_all_frames_within(at: float) -> None:
    frames = [k * PERIOD for k in range(300)]
    assert sum(is_active(fault(at), t, PERIOD) for t in frames) == 1
    active = [t for t in frames if is_active(fault(at, 0.5), t, PERIOD)]
    assert at <= active[0] < at + PERIOD
    assert active[-1] < at + 0.5


def test_a_run_shows_the_faults_and_keeps_the_truth(tmp_path_factory: pytest.TempPathFactory) -> None:
    faults = (
        '[{kind="freeze", at_s=0.2, duration_s=0.1, body="both"}, {kind="dropout", at_s=0.4, duration_s=0.2},'
        ' {kind="step", at_s=0.7, duration_s=0.1, offset=[0.0, 5.0]}]'
    )
    path = tmp_path_factory.mktemp("faults") / "run.mcap"
    run_lockstep(load_scenario("turtlebot3", ["run.duration_s=1", f"mocap.faults={faults}"]), path)
    log = read_log(path)
    seen = [decode_as(record.payload, msg.RigidBodies) for record in log.records([topics.RIGID_BODIES])]
    frozen = sum(
        one.rigidbodies[0].pose == other.rigidbodies[0].pose
        and one.rigidbodies[1].pose == other.rigidbodies[1].pose
        for one, other in pairwise(seen)
    )
    assert frozen == pytest.approx(12, abs=1)
    gaps = [to_ns(other.header.stamp) - to_ns(one.header.stamp) for one, other in pairwise(seen)]
    assert max(gaps) * 1e-9 == pytest.approx(0.2, abs=0.02)
    assert sum(frame.rigidbodies[0].pose.position.y > 4.0 for frame in seen) == pytest.approx(12, abs=1)
    truth = [decode_as(record.payload, msg.Truth) for record in log.records([topics.TRUTH])]
    assert all(abs(each.leader_y) < 1.0 for each in truth)


def test_mistakes_in_a_list_of_faults_are_named() -> None:
    for given, told in (
        ('{kind="swap", at_s=1, boddy="leader"}', "did you mean 'body'"),
        ('{kind="swp", at_s=1}', "'freeze'"),
        ('{kind="swap"}', "at_s"),
    ):
        with pytest.raises(UsageError, match=told):
            EmulatorNode(load_scenario("turtlebot3", [f"mocap.faults=[{given}]"]))
