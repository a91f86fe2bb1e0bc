"""When something was bad, and why: the spells of a summary as a list."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from typing import Any

from hil.judge.spell_words import longest_first, spell_told, times_of
from hil.reports.notation import written

MOST_SPELLS = 50


def spell_list(summary: Mapping[str, Any]) -> str:
    """List of the bad spells of a summary in the order of time, the longest if there are many."""
    spells = summary.get("spells", [])
    if not spells:
        return ""
    longest = sorted(longest_first(spells)[:MOST_SPELLS], key=lambda spell: float(spell["from_s"]))
    listed = "".join(
        f"<dt>{escape(times_of(spell))}</dt><dd>{escape(written(spell_told(spell)))}</dd>"
        for spell in longest
    )
    more = f", the {MOST_SPELLS} longest of {len(spells)}" if len(spells) > MOST_SPELLS else ""
    return f'<p class="soft">When something was bad, and why{more}.</p><dl>{listed}</dl>'
