"""Who takes part in a run, by what of the lab there is."""

from __future__ import annotations

from pathlib import Path

import pytest

from hil.live.crew import Crew

ROBOTS = ("alice", "bob")
LOG = Path("run.mcap")


@pytest.mark.parametrize(
    ("crew", "daemons"),
    [
        (Crew(), ("recorder", "follower", "emulator")),
        (Crew(real=True), ("recorder", "follower", "leader")),
        (Crew(real=True, apart=True), ("recorder", "estimator", "controller", "leader")),
        (Crew(real=True, emulate="leader"), ("recorder", "follower", "emulator")),
        (Crew(real=True, emulate="follower"), ("recorder", "follower", "leader", "emulator")),
    ],
)
def test_what_exists_is_not_emulated_and_one_daemon_lets_the_leader_set_off(
    crew: Crew, daemons: tuple[str, ...]
) -> None:
    assert crew.daemons == daemons
    assert crew.drives_leader == ("leader" in daemons)


def test_the_one_that_sets_off_waits_for_all_others() -> None:
    crew = Crew(real=True, emulate="follower", countdown_s=7.0)
    needs = ["--needs", "recorder,follower,guard/alice"]
    assert crew.options("leader", LOG, ROBOTS) == [*needs, "--countdown", "7.0"]
    assert crew.options("emulator", LOG, ROBOTS) == needs
    assert crew.options("recorder", LOG, ROBOTS) == ["--out", "run.mcap"]
    assert crew.options("follower", LOG, ROBOTS) == []


def test_a_run_wants_a_guard_on_every_real_robot_that_it_commands() -> None:
    assert Crew(real=True).guards(ROBOTS) == ("guard/alice", "guard/bob")
    assert Crew(real=True, by_hand=True).guards(ROBOTS) == ("guard/bob",)
    assert Crew(real=True, emulate="leader").guards(ROBOTS) == ("guard/bob",)
    assert Crew(real=True, emulate="follower").guards(ROBOTS) == ("guard/alice",)
    assert Crew().guards(ROBOTS) == ()
    without = Crew(real=True, guarded=False)
    assert without.guards(ROBOTS) == ()
    for daemon in without.daemons:
        assert "--no-guard" in without.options(daemon, LOG, ROBOTS)


def test_a_hand_counts_down_itself() -> None:
    crew = Crew(real=True, by_hand=True)
    assert crew.options("leader", LOG, ROBOTS) == ["--needs", "recorder,follower,guard/bob", "--by-hand"]
    assert not crew.drives_leader
