"""Frames for tables that are wider than the page: what can be scrolled shows that it can, and names stay."""

from __future__ import annotations

import re
from collections.abc import Sequence
from html import escape

SCROLL_STYLE = """<style>
.scrolls { position: relative; } .scrolls > .wide { border: 1px solid var(--line); border-radius: .3rem;
  padding: .3rem .6rem; scrollbar-width: thin;
  background: linear-gradient(to right, var(--frame) 30%, transparent) left / 2.5rem 100% no-repeat local,
    linear-gradient(to left, var(--frame) 30%, transparent) right / 2.5rem 100% no-repeat local,
    radial-gradient(farthest-side at 0 50%, #7779, transparent) left / .9rem 100% no-repeat scroll,
    radial-gradient(farthest-side at 100% 50%, #7779, transparent) right / .9rem 100% no-repeat scroll; }
.scrolls > .wide:focus-visible { outline: 2px solid currentColor; }
.scrolls td, .scrolls thead th { white-space: nowrap; } .scrolls .long td { white-space: normal; }
:root { --frame: #fff; }
@media (prefers-color-scheme: dark) { :root { --frame: Canvas; } }
</style>
"""


_PLAIN = '<div class="wide">'
_CAPTION = re.compile(r"<caption>(.*?)</caption>", re.DOTALL)


def framed(table: str) -> str:
    """A table of :func:`hil.reports.page.table_html` in a frame with shadows where there is more to see.

    It can be scrolled by keyboard. Its caption stands above the frame, where it is not cut off.
    """
    if not table:
        return ""
    found = _CAPTION.search(table)
    caption = found[1] if found else "table"
    bare = _CAPTION.sub("", table, count=1)
    inner = bare.replace(_PLAIN, f'<div class="wide" tabindex="0" role="region" aria-label="{caption}">', 1)
    above = f'<p class="soft">{caption}</p>' if found else ""
    return f'<div class="scrolls">{above}{inner}</div>'


def framed_rows(caption: str, header: Sequence[str], rows: Sequence[str]) -> str:
    """A framed table of rows that are ready HTML, as some hold links; empty without any."""
    if not rows:
        return ""
    head = "".join(f'<th scope="col">{escape(each)}</th>' for each in header)
    title = f"<caption>{escape(caption)}</caption>" if caption else ""
    body = f"<thead><tr>{head}</tr></thead>\n<tbody>{''.join(rows)}</tbody>"
    return framed(f'{_PLAIN}<table class="many">{title}{body}</table></div>')
