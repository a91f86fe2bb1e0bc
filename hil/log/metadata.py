"""What a log says of itself: the scenario it was made with, its seed, its mode and our version."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Mapping
from typing import Any

from hil import __version__
from hil.errors import UsageError
from hil.log.description import ORIGIN, RECORD
from hil.log.older_keys import with_older_keys
from hil.log.own_sources import source_metadata
from hil.log.reader import Log
from hil.log.report_json import as_json
from hil.scenario.files import build_scenario, scenario_text
from hil.scenario.schema import Scenario

CERTIFICATE = "abreast.certificate"
IMPORT = "import"
"""Mode of a log that was made from another recording."""
LIVE = "live"
"""Mode of a log that a recorder wrote."""


def log_metadata(scenario: Scenario, mode: str) -> dict[str, dict[str, str]]:
    """Metadata records of a log; ``mode`` is live, lockstep or import."""
    record = {
        "version": __version__,
        "mode": mode,
        "scenario": scenario.name,
        "seed": str(scenario.run.seed),
        "scenario_toml": scenario_text(scenario),
    }
    return {RECORD: record} | source_metadata(scenario)


def scenario_of(log: Log) -> Scenario | None:
    """Scenario that a log was made with, as it meant then; None for a log that is not ours.

    Raises :class:`UsageError` if the log names one that this version cannot read.
    """
    text = log.metadata.get(RECORD, {}).get("scenario_toml")
    if text is None:
        return None
    try:
        tree = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise UsageError(f"log {log.path}: its scenario is not readable as TOML ({error})") from None
    return build_scenario(with_older_keys(tree), source=f"log {log.path}: scenario")


def mode_of(log: Log) -> str | None:
    """Mode in which a log was made; None for a log that is not ours."""
    return log.metadata.get(RECORD, {}).get("mode")


def truth_is_of_bodies(log: Log) -> bool:
    """Whether the truth that a log has was made of mocap poses, as an import of MRCLAM's is."""
    return "folder" in log.metadata.get("source", {})


def version_of(log: Log) -> str | None:
    """Version of abreast that wrote a log; None for a log that is not ours or does not say."""
    return log.metadata.get(RECORD, {}).get("version")


def cut_in_front_s(log: Log) -> float:
    """Seconds of log time that are missing in front of a log; 0 where none are known to be."""
    begun_ns = log.metadata.get(ORIGIN, {}).get("begun_ns", "")
    if log.start_ns is None or not begun_ns.isdecimal():
        return 0.0
    return max(0.0, (log.start_ns - int(begun_ns)) * 1e-9)


def certificate_metadata(certificate: Mapping[str, Any]) -> dict[str, dict[str, str]]:
    """Metadata record with a certificate, given as JSON of ``abreast bounds``."""
    return {CERTIFICATE: {"json": as_json(certificate)}}


def recorded_certificate(log: Log) -> dict[str, Any] | None:
    """Certificate that a log carries, as JSON of ``abreast bounds``; None if it has none."""
    text = log.metadata.get(CERTIFICATE, {}).get("json")
    return None if text is None else json.loads(text)
