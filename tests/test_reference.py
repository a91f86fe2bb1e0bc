"""Outputs are those of the reference logs; where they are meant to differ: `scripts/renew-reference`."""

from __future__ import annotations

from pathlib import Path

import pytest

from hil.log.metadata import scenario_of
from hil.log.reader import read_log
from hil.wire import topics
from hil.wire.topics import topics_of
from tests.reference_logs import (
    FLIGHTS,
    FOLDER,
    WRITTEN_ON,
    flown_anew,
    hardware,
    path_of,
    replayed,
    same_hardware,
    scenario_for,
    written_on,
)

LARGEST_BYTES = 150_000


def told(name: str, lines: list[str]) -> str:
    """What to say of differences."""
    version = written_on()["abreast"]
    renewing = "if that is meant to be so, scripts/renew-reference keeps the new ones"
    return "\n".join([f"{name}, written by abreast {version}, gives other outputs; {renewing}", *lines])


@pytest.mark.parametrize("name", FLIGHTS)
def test_the_nodes_make_the_same_of_recorded_inputs(name: str) -> None:
    lines = replayed(read_log(path_of(name)), exactly=same_hardware())
    assert not lines, told(name, lines)


@pytest.mark.parametrize("name", FLIGHTS)
def test_the_same_flight_leaves_the_same_messages(name: str, tmp_path: Path) -> None:
    lines = flown_anew(read_log(path_of(name)), tmp_path, exactly=same_hardware())
    assert not lines, told(name, lines)


@pytest.mark.parametrize("name", FLIGHTS)
def test_a_reference_log_is_small_and_of_the_flight_that_its_name_stands_for(name: str) -> None:
    log = read_log(path_of(name))
    assert scenario_of(log) == scenario_for(name)
    assert path_of(name).stat().st_size < LARGEST_BYTES
    names = topics_of(scenario_for(name))
    assert {
        topics.RIGID_BODIES,
        topics.TRUTH,
        names.estimate,
        names.command,
        names.cmd_vel,
    } <= log.topics.keys()


def test_nothing_else_lies_beside_the_reference_logs() -> None:
    assert set(FOLDER.iterdir()) == {WRITTEN_ON, *map(path_of, FLIGHTS)}
    assert written_on().keys() == {"abreast", *hardware()}
