"""The option of commands that leave pictures: each figure on its own, too, for a paper."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import click

from hil.errors import UsageError

F = TypeVar("F", bound=Callable[..., Any])


def figures_option() -> Callable[[F], F]:
    """``--figures pdf|svg``, the argument ``figures``."""
    return click.option(
        "--figures",
        type=click.Choice(("pdf", "svg")),
        help="Every figure as a file of its own as well, for a two-column paper, in DIR/figures.",
    )


def refuse_nowhere(figures: str | None, out: Path | None) -> None:
    """Raise :class:`UsageError` for figures without a folder to put them in."""
    if figures is not None and out is None:
        raise UsageError(f"--figures {figures}: goes into a folder for results; give --out DIR")
