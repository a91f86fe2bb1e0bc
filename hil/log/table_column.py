"""What a column of a table is called, in which unit, and what it means."""

from __future__ import annotations

from typing import NamedTuple


class TableColumn(NamedTuple):
    """A column. ``unit``: empty for what has none."""

    name: str
    unit: str
    description: str
