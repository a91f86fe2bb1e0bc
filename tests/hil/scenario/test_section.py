"""No number is absurd enough for a traceback or a hang: a scenario is refused in one line, or it runs."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from hil.errors import AbreastError, UsageError
from hil.judge.run_data import run_data_of_log
from hil.judge.summary import summarise
from hil.lockstep.run import run_lockstep
from hil.log.metadata import scenario_of
from hil.log.reader import read_log
from hil.scenario.files import build_scenario, load_scenario, refuse_unrunnable, scenario_text
from hil.scenario.schema import Scenario
from tests.hil.scenario.schema_numbers import Number, numbers

MANY_AGENTS = 10
"""More than these are no absurdity, and take their time."""

NUMBERS = list(numbers())
NAMES = [f"{each.key} {each.text}" for each in NUMBERS]


def one_line(refused: AbreastError) -> None:
    assert "\n" not in str(refused)


def loaded(number: Number, value: object) -> Scenario | None:
    """The scenario with a value, None where it is refused in one line."""
    try:
        return load_scenario("turtlebot3", ["run.duration_s=0.3", *number.given, number.override(value)])
    except UsageError as refused:
        one_line(refused)
        return None


def takes_its_time(number: Number, value: object) -> bool:
    if number.key.endswith(".agents"):
        return isinstance(value, int) and MANY_AGENTS < value <= 2000
    return bool(number.key == "run.duration_s" and value == number.high)


def test_every_number_is_known() -> None:
    assert len({each.key for each in NUMBERS}) > 90


@pytest.mark.parametrize("number", NUMBERS, ids=NAMES)
def test_a_number_is_refused_in_one_line_or_comes_out_as_it_went_in(number: Number) -> None:
    assert loaded(number, 1e300) is None
    for value in number.values:
        scenario = loaded(number, value)
        if scenario is not None:
            assert build_scenario(tomllib.loads(scenario_text(scenario))) == scenario


def runs(number: Number, value: object, folder: Path) -> None:
    scenario = loaded(number, value)
    if scenario is None or takes_its_time(number, value):
        return
    log = folder / "run.mcap"
    log.unlink(missing_ok=True)
    try:
        refuse_unrunnable(scenario)
        run_lockstep(scenario, log)
        read = read_log(log)
        assert scenario_of(read) == scenario
        summarise(run_data_of_log(read))
    except AbreastError as refused:
        one_line(refused)


@pytest.mark.slow
@pytest.mark.parametrize("number", NUMBERS, ids=NAMES)
def test_what_is_not_refused_runs_and_is_judged(number: Number, tmp_path: Path) -> None:
    for value in number.values:
        runs(number, value, tmp_path)


@pytest.mark.parametrize(
    "overrides",
    [
        ["controller.mu_rho=9999999999999999999999"],
        ["leader.v_eps=1e9", "mocap.clock_jump_s=0.5"],
        ["leader.v_eps=1.0", "leader.k_v=0.5"],
        ["chain.agents=3", "leader.k_v=1.0", "leader.v_eps=0.9"],
        ["formation.rho_0=1e9", "leader.k_u=9999999999999999999999"],
        ["run.seed=99999999999999999999999"],
        ["controller.law=file.py:law", "controller.parameters.k=1e15"],
    ],
)
def test_what_no_lab_has_and_what_contradicts_itself_is_refused_in_one_line(overrides: list[str]) -> None:
    with pytest.raises(UsageError, match="expected") as refused:
        load_scenario("turtlebot3", overrides)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    "overrides",
    [
        ["follower.name=leader"],
        ["follower.name=leader", "follower.body=b", "follower.namespace=n"],
        ["follower.body=leader"],
        ["leader.body=1", "follower.body='1'"],
        ["follower.namespace=leader"],
        ["leader.namespace=''", "follower.namespace=''"],
        ["chain.agents=3", "chain.names=['leader']"],
        ["chain.agents=3", "chain.names=['third']", "chain.bodies=['follower']"],
        ["chain.agents=3", "chain.namespaces=['follower']"],
        ["chain.agents=4", "chain.names=['third', 'third']"],
    ],
)
def test_a_name_of_two_robots_is_refused_by_whoever_reads_the_scenario(overrides: list[str]) -> None:
    with pytest.raises(UsageError, match="stands for two robots") as refused:
        load_scenario("turtlebot3", overrides)
    assert "\n" not in str(refused.value)
