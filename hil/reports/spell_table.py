"""When something was bad, and why: the spells of a summary as a table."""

from __future__ import annotations

from collections.abc import Mapping
from math import degrees
from typing import Any

from hil.judge.spell_words import longest_first, times_of
from hil.reports.notation import written
from hil.reports.page import table_html

MOST_SPELLS = 50


def spell_table(summary: Mapping[str, Any]) -> str:
    """Table of the bad spells of a summary in the order of time, the longest if there are many."""
    spells = summary.get("spells", [])
    longest = sorted(longest_first(spells)[:MOST_SPELLS], key=lambda spell: float(spell["from_s"]))
    rows = [
        (
            times_of(spell),
            written("; ".join(spell["causes"])),
            _worst(spell, "v1", 1e3, "mm/s"),
            _worst(spell, "alpha1", degrees(1.0), "deg"),
        )
        for spell in longest
    ]
    more = f"; the {MOST_SPELLS} longest of {len(spells)}" if len(spells) > MOST_SPELLS else ""
    caption = f"When something was bad, and why{more}"
    return table_html(caption, ("", "what", "v₁ off by up to", "α₁ off by up to"), rows, long=True)


def _worst(spell: Mapping[str, Any], name: str, scale: float, unit: str) -> str:
    worst = spell.get("worst", {}).get(name)
    return "–" if worst is None else f"{scale * worst['error']:.3g} {unit} at {worst['at_s']:.2f} s"
