from __future__ import annotations

from hil.errors import UsageError
from hil.scenario.files import load_scenario
from hil.scenario.keys import settable_keys

KEYS = settable_keys()


def refusal(scenario: str, override: str) -> str:
    """What is said against an override; empty where nothing is."""
    try:
        load_scenario(scenario, [override])
    except UsageError as error:
        return str(error)
    return ""


def test_no_key_is_offered_that_a_scenario_does_not_know() -> None:
    for key in KEYS:
        name = {"chain": "chain5-turtlebot3", "flock": "flock"}.get(key.partition(".")[0], "turtlebot3")
        # A program has the keys of its kind only.
        assert key.startswith("leader.program.") or "unknown key" not in refusal(name, f"{key}=[]"), key


def test_every_value_that_is_offered_is_taken() -> None:
    for key, values in KEYS.items():
        for value in values:
            assert "expected one of" not in refusal("turtlebot3", f"{key}={value}"), (key, value)
