"""Results: as JSON, where what cannot be known is absent, and where commands print them.

Results go to stdout, progress and notes to stderr. Where one JSON object is asked for it is alone on stdout,
and what a person reads of the same goes to stderr too.
"""

from __future__ import annotations

import contextlib
import json
import math
import os
import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextvars import ContextVar
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO, cast

import click

from hil.log.written_aside import write_text_aside

if TYPE_CHECKING:
    from rich.console import Console

_UNFOLDED = 400
"""Columns where no terminal says how many it has: lines of a file are not folded."""


def known(value: Any) -> Any:
    """Value with plain Python types, and without entries that are None or not finite, or empty for that."""
    if isinstance(value, Mapping):
        kept = {str(key): known(item) for key, item in value.items()}
        return {key: item for key, item in kept.items() if item is not None and item != {}}
    if hasattr(value, "tolist"):
        # An array or a number of numpy, which the command line loads for its results only.
        return known(value.tolist())
    if isinstance(value, Sequence) and not isinstance(value, str):
        return [known(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def flat(tree: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Values with their names; what is nested gets names like ``rmse.v1``."""
    for key, value in tree.items():
        if isinstance(value, Mapping):
            yield from flat(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value


def as_json(result: Mapping[str, Any], indent: int | None = None) -> str:
    """JSON text of a result."""
    return json.dumps(known(result), indent=indent, allow_nan=False)


_results: ContextVar[TextIO | None] = ContextVar("results", default=None)


@contextlib.contextmanager
def results_apart() -> Iterator[None]:
    """Keep stdout for results: what laws and estimators of others print meanwhile goes to stderr."""
    if _results.get() is not None:
        yield
        return
    token = _results.set(sys.stdout)
    try:
        with contextlib.redirect_stdout(sys.stderr):
            yield
    finally:
        _results.reset(token)


def print_json(result: Mapping[str, Any]) -> None:
    """Print a result as one JSON object on one line of stdout."""
    click.echo(as_json(result), file=_results.get())


def print_with_nulls(result: Mapping[str, Any]) -> None:
    """The same of one that is known already, in which null says that something is not."""
    click.echo(json.dumps(result, allow_nan=False), file=_results.get())


def print_text(text: str) -> None:
    """Print a result that is text on stdout."""
    click.echo(text, file=_results.get(), nl=False)


def say(line: str) -> None:
    """Print a line of what a person reads of a result."""
    click.echo(line, file=_readers())


def note(line: str) -> None:
    """Print a line of progress, or of what is worth to know on the way, on stderr."""
    click.echo(line, err=True)


def result_console() -> Console:
    """What prints tables and colours of what a person reads of a result."""
    from rich.console import Console

    file = _readers()
    if file.isatty() or "COLUMNS" in os.environ:
        return Console(file=file, highlight=False)
    return Console(file=cast(TextIO, _Unpadded(file)), width=_UNFOLDED, highlight=False)


class _Unpadded:
    """A file whose lines end where their words do: columns of a table are as wide as their longest cell."""

    def __init__(self, file: TextIO) -> None:
        self._file = file

    def write(self, text: str) -> int:
        return self._file.write(re.sub(r" +$", "", text, flags=re.MULTILINE))

    def flush(self) -> None:
        self._file.flush()


def _readers() -> TextIO:
    """Where people read results: stdout, or stderr where one JSON object is to be alone there."""
    context = click.get_current_context(silent=True)
    if context is not None and context.params.get("as_json"):
        return sys.stderr
    return _results.get() or sys.stdout


def write_json(result: Mapping[str, Any], path: Path) -> None:
    """Write a result to a file, indented; it is whole or not there."""
    write_text_aside(path, as_json(result, indent=2) + "\n")
