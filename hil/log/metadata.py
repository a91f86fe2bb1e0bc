"""What a log says of itself: the scenario it was made with, its seed, its mode and our version."""

from __future__ import annotations

import tomllib

from hil import __version__
from hil.certificate import certificate_metadata
from hil.errors import UsageError
from hil.log.reader import Log
from hil.scenario.files import build_scenario, scenario_text
from hil.scenario.schema import Scenario

RECORD = "abreast"
IMPORT = "import"
"""Mode of a log that was made from another recording."""


def log_metadata(scenario: Scenario, mode: str) -> dict[str, dict[str, str]]:
    """Metadata records of a log, with the scenario's certificate; ``mode`` is live, lockstep or import."""
    about = {
        RECORD: {
            "version": __version__,
            "mode": mode,
            "scenario": scenario.name,
            "seed": str(scenario.run.seed),
            "scenario_toml": scenario_text(scenario),
        }
    }
    return about | certificate_metadata(scenario, driven=mode != IMPORT)


def scenario_of(log: Log) -> Scenario | None:
    """Scenario that a log was made with; None for a log that is not ours.

    Raises :class:`UsageError` if the log names one that this version cannot read.
    """
    text = log.metadata.get(RECORD, {}).get("scenario_toml")
    if text is None:
        return None
    try:
        tree = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise UsageError(f"log {log.path}: its scenario is not readable as TOML ({error})") from None
    return build_scenario(tree, source=f"log {log.path}: scenario")


def mode_of(log: Log) -> str | None:
    """Mode in which a log was made; None for a log that is not ours."""
    return log.metadata.get(RECORD, {}).get("mode")
