from __future__ import annotations

import re
from typing import Any

import pytest

from hil.judge.run_data import RunData
from hil.judge.summary import summarise
from hil.reports.reasons import reasons_of, verdict_html, warnings_html


@pytest.fixture
def summary(exact_run_data: RunData) -> dict[str, Any]:
    return summarise(exact_run_data)


def styles(summary: dict[str, Any]) -> dict[str, str]:
    return {reason.part: reason.style for reason in reasons_of(summary)}


def sentence(summary: dict[str, Any]) -> str:
    found = re.search(r"<strong>(.*?)</strong>", verdict_html(summary))
    assert found is not None
    return found[1]


def test_a_good_run_has_reasons_and_one_sentence(summary: dict[str, Any]) -> None:
    assert set(styles(summary).values()) == {"good"}
    assert sentence(summary) == "All bounds held, and nothing speaks against the run."


@pytest.mark.parametrize(
    ("part", "change", "style", "said"),
    [
        ("commands", {"saturated": 200, "sent": 240}, "warn", "but saturation deserves a second look."),
        ("frames", {"lost": 24, "published": 240}, "warn", "but latency deserves a second look."),
        ("bounds", {"violations": {"v1_extended": 3}}, "bad", "Bounds: extended ones violated 3 times in"),
        ("estimation", {"samples": 0}, "bad", "Tracking: no estimate was marked as tracking."),
    ],
)
def test_what_speaks_against_a_run_is_in_the_sentence_and_at_its_place(
    summary: dict[str, Any], part: str, change: dict[str, Any], style: str, said: str
) -> None:
    summary[part] = summary[part] | change
    (judged,) = (part for part, its_style in styles(summary).items() if its_style == style)
    assert said in sentence(summary)
    assert f'class="verdict {style}"' in verdict_html(summary)
    assert warnings_html(summary, judged)


def test_what_to_look_at_again_is_said_in_few_words(summary: dict[str, Any]) -> None:
    summary["bounds"]["input_errors_hold"] = {"E_v2": 0.8, "all": 0.64}
    summary["frames"] = summary["frames"] | {"lost": 24, "published": 240}
    told = {reason.part: reason.text for reason in reasons_of(summary) if reason.style == "warn"}
    assert set(told) == {"bounds", "latency"}
    assert "held in all" in told["bounds"]
    assert told["bounds"].endswith(
        "; inputs err as little as the scenario assumes in 64% of the samples only"
    )
    summary["rejected"] = {"follower_outlier": 8, "gated": 5}
    assert reasons_of(summary)[4].text.endswith("; inputs refused: follower outlier 8, gated 5")
    assert told["latency"].endswith("; 10.0% of the frames never reached the estimator")


def test_a_pair_far_off_its_station_is_looked_at_again(summary: dict[str, Any]) -> None:
    summary["formation"]["equilibrium_deviation_rms"]["rho"] = 3.0
    assert styles(summary)["formation"] == "warn"
    assert "3 m RMS off its station" in verdict_html(summary)


def test_what_nobody_knows_is_no_reason(summary: dict[str, Any]) -> None:
    bare = {"estimation": summary["estimation"], "bounds": {}}
    assert styles(bare) == {"tracking": "good"}
    assert sentence(bare) == "Nothing speaks against the run."
