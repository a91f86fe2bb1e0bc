"""Logs mean what they meant when they were written."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from hil.log import metadata
from hil.log.description import RECORD
from hil.log.metadata import scenario_of
from hil.log.older_keys import BEFORE, with_older_keys
from hil.log.reader import read_log
from hil.scenario.files import scenario_text

REFERENCES = sorted((Path(__file__).resolve().parents[2] / "reference").glob("*.mcap"))


def keys(tree: Mapping[str, Any]) -> set[str]:
    return {f"{section}.{key}" for section, held in tree.items() if isinstance(held, dict) for key in held}


@pytest.mark.parametrize("path", REFERENCES, ids=lambda path: path.stem)
def test_every_key_younger_than_a_log_has_the_value_it_had_before(path: Path) -> None:
    log = read_log(path)
    scenario = scenario_of(log)
    assert scenario is not None
    held = keys(tomllib.loads(log.metadata[RECORD]["scenario_toml"]))
    assert keys(tomllib.loads(scenario_text(scenario))) - held <= BEFORE.keys()


def test_a_log_without_a_key_is_not_given_todays_default(monkeypatch: pytest.MonkeyPatch) -> None:
    log = read_log(REFERENCES[0])
    record = log.metadata[RECORD]
    text = "\n".join(line for line in record["scenario_toml"].splitlines() if not line.startswith("k_v "))
    assert text != record["scenario_toml"]
    older = replace(log, metadata={RECORD: {**record, "scenario_toml": text}})
    monkeypatch.setattr(
        metadata, "with_older_keys", lambda tree: with_older_keys(tree, {"leader.k_v": 0.123})
    )
    found = scenario_of(older)
    assert found is not None
    assert found.leader.k_v == 0.123
