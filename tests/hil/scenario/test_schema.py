from __future__ import annotations

import math
import re
from itertools import zip_longest
from pathlib import Path
from typing import Any, get_args

from msgspec import Struct
from msgspec.structs import fields

from estimation.filters.estimators import ESTIMATORS
from hil.scenario.schema import OFFLINE_ESTIMATORS, EstimatorName, Scenario

KEYS = Path(__file__).parents[3] / "docs" / "scenario.md"
IN_WORDS = {0.5 * math.pi: "pi/2", math.pi / 7.0: "pi/7"}


def test_a_scenario_can_ask_for_every_estimator_there_is_and_for_no_other() -> None:
    assert get_args(EstimatorName) == tuple(ESTIMATORS)
    assert not {*OFFLINE_ESTIMATORS} & ESTIMATORS.keys()


def written(default: Any) -> str:
    """Default as the table of keys writes it, nothing for one that is no single value."""
    if isinstance(default, bool):
        return str(default).lower()
    if isinstance(default, str):
        return default
    return IN_WORDS.get(default, f"{default:g}") if isinstance(default, int | float) else ""


def keys_documented() -> dict[str, dict[str, str]]:
    """Default of every key by section, as the document has it; a row may hold several keys."""
    documented: dict[str, dict[str, str]] = {}
    section = ""
    for line in KEYS.read_text(encoding="utf-8").splitlines():
        if heading := re.match(r"## \[(\w+)\]", line):
            section = heading[1]
            documented[section] = {}
        elif row := re.match(r"\| (`.*?) \|(.*?)\|", line):
            names = re.findall(r"`(\w+)`", row[1])
            documented[section] |= zip_longest(names, filter(None, row[2].strip().split(", ")), fillvalue="")
    return documented


def test_every_key_is_documented_with_its_default() -> None:
    wanted = {}
    for part in fields(Scenario):
        for kind in (part.type, *get_args(part.type)):
            if isinstance(kind, type) and issubclass(kind, Struct):
                wanted[part.name] = {
                    key.name: "" if key.required else written(key.default) for key in fields(kind)
                }
    assert keys_documented() == wanted
