"""A finding goes from a node's diagnostics to whoever reads them, with what to do about it."""

from __future__ import annotations

from hil.nodes.findings import (
    ADVICE,
    Findings,
    advice_on,
    all_found,
    finding_line,
    findings_in,
    findings_json,
    named_findings,
)
from hil.nodes.node import diagnostics

SILENT = {"odometry_silent": "no odometry for 1.2 s, expected 30 a second"}


def test_findings_come_out_of_diagnostics_as_they_went_in() -> None:
    report = diagnostics("estimator", 5, "", {"status": "tracking", **named_findings(SILENT)})
    assert findings_in(report) == {"estimator": SILENT}
    assert findings_in(diagnostics("controller", 5, "", {"finding.": "of no name"})) == {"controller": {}}


def test_all_that_was_ever_found_is_kept_in_its_last_words() -> None:
    later = {"odometry_silent": "no odometry for 9 s, expected 30 a second"}
    reports: list[dict[str, Findings]] = [
        {"a": SILENT, "b": {}},
        {"a": {}},
        {"a": later, "b": {"clock": "behind"}},
        {"a": {}},
    ]
    assert all_found(reports) == {"a": later, "b": {"clock": "behind"}}


def test_deviations_that_wrong_odometry_explains_are_not_blamed_on_the_sigmas() -> None:
    (alone,) = findings_json({"nees": "too confident"})
    assert "set the sigmas" in alone["advice"]
    assert 'odometry shows so as well, which estimator.own_motion = "auto" judges' in alone["advice"]
    _, beside = findings_json({"odometry_contradicts": "scaled by 0.53", "nees": "too confident"})
    assert beside["advice"].startswith("odometry_contradicts was found as well")
    assert "mend that first" in beside["advice"]


def test_every_finding_has_an_advice_in_one_line() -> None:
    (found,) = findings_json(SILENT)
    assert found == {"name": "odometry_silent", "text": SILENT["odometry_silent"], "advice": found["advice"]}
    assert finding_line(found) == f"odometry_silent: {found['text']}; {ADVICE['odometry_silent']}"
    assert advice_on("never heard of").startswith("look at")
    assert not [advice for advice in ADVICE.values() if "\n" in advice or not advice.strip()]
