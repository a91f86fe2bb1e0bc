"""Frames for tables that are wider than the page, under captions that are not cut off."""

from __future__ import annotations

import re
from collections.abc import Sequence
from html import escape

FRAME_STYLE = """<style>
.firm td, .firm thead th { white-space: nowrap; } .firm .long td { white-space: normal; }
.firm tbody th { position: sticky; left: -.5rem; padding-left: .5rem; background: var(--ground); }
.firm td.said { text-align: left; white-space: normal; min-width: 14rem; }
.firm.told thead th:nth-child(2) { text-align: left; }
@media (max-width: 48rem) {
  .firm tbody th { min-width: 8rem; max-width: 9.5rem; overflow-wrap: break-word; } }
</style>
"""
"""Goes once into a page with framed tables: their numbers do not break, and their rows' names stay."""

_PLAIN = '<div class="wide">'
_CAPTION = re.compile(r"<caption>(.*?)</caption>", re.DOTALL)


def framed(table: str) -> str:
    """A table of :func:`hil.reports.page.table_html` with its caption above its frame, and read out by it."""
    if not table:
        return ""
    found = _CAPTION.search(table)
    caption = found[1] if found else "table"
    bare = _CAPTION.sub("", table, count=1)
    inner = bare.replace(_PLAIN, f'<div class="wide firm" role="region" aria-label="{caption}">', 1)
    above = f'<p class="soft">{caption}</p>' if found else ""
    return above + inner


def framed_rows(caption: str, header: Sequence[str], rows: Sequence[str]) -> str:
    """A framed table of rows that are ready HTML, as some hold links; empty without any."""
    if not rows:
        return ""
    head = "".join(f'<th scope="col">{escape(each)}</th>' for each in header)
    title = f"<caption>{escape(caption)}</caption>" if caption else ""
    body = f"<thead><tr>{head}</tr></thead>\n<tbody>{''.join(rows)}</tbody>"
    return framed(f'{_PLAIN}<table class="many">{title}{body}</table></div>')
