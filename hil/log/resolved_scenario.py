"""The scenario of a run beside its log, with all that overrides and options made of it."""

from __future__ import annotations

from pathlib import Path

from hil.errors import UsageError
from hil.log.written_aside import write_text_aside
from hil.scenario.files import scenario_text
from hil.scenario.schema import Scenario

RESOLVED = "scenario.toml"


def write_resolved(scenario: Scenario, folder: Path) -> Path:
    """Write the scenario into the folder of a run's results; raises :class:`UsageError` if it cannot be."""
    path = folder / RESOLVED
    try:
        write_text_aside(path, scenario_text(scenario))
    except OSError as error:
        raise UsageError(
            f"--out {folder}: cannot be written ({error.strerror}); give another folder"
        ) from None
    return path
