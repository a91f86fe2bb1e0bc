"""The matrix is whole: every role by every signal, in both kinds of lab."""

from __future__ import annotations

import pytest

from hil.faults.fault import LinkFault, Signal
from hil.faults.lab import ROBOTS
from hil.faults.matrix import CUTS_S, ROLES, SIGNALS, faults
from hil.scenario.files import load_scenario

FAULTS = faults()


def test_every_role_meets_every_signal_by_a_supervisor_and_by_hand() -> None:
    met = {(fault.setting.how, fault.role, fault.mode) for fault in FAULTS if isinstance(fault.act, Signal)}
    assert met == {(how, role, mode) for how in ("run", "hand") for role in ROLES for mode in SIGNALS}


@pytest.mark.parametrize("link", ["relay", "netns"])
def test_links_are_cut_for_every_time(link: str) -> None:
    cuts = [
        fault.act.for_s
        for fault in FAULTS
        if fault.setting.link == link and isinstance(fault.act, LinkFault) and fault.mode == "cut"
    ]
    assert sorted(cuts) == sorted(CUTS_S)


def test_names_are_unique_and_robots_known() -> None:
    names = [fault.name for fault in FAULTS]
    assert len(set(names)) == len(names)
    assert all(fault.expected.stands.keys() <= set(ROBOTS) for fault in FAULTS)


@pytest.mark.parametrize(
    "fault", [each for each in FAULTS if each.setting.options], ids=lambda fault: fault.name
)
def test_what_a_fault_sets_is_a_scenarios(fault: object) -> None:
    (options,) = [each.setting.options for each in FAULTS if each is fault]
    overrides = [word for word in options if word != "--set"]
    assert load_scenario("turtlebot3", overrides) != load_scenario("turtlebot3")


def test_alone_the_guards_own_death_and_freeze_are_not_covered() -> None:
    uncovered = {(fault.role, fault.mode) for fault in FAULTS if fault.uncovered}
    assert uncovered == {("guard", "kill"), ("guard", "stop")}
