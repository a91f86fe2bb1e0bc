"""Results as JSON: what cannot be known is absent, never made up."""

from __future__ import annotations

import contextlib
import json
import math
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextvars import ContextVar
from pathlib import Path
from typing import Any, TextIO

import click
import numpy as np

from hil.log.written_aside import write_text_aside


def known(value: Any) -> Any:
    """Value with plain Python types, and without entries that are None or not finite, or empty for that."""
    if isinstance(value, Mapping):
        kept = {str(key): known(item) for key, item in value.items()}
        return {key: item for key, item in kept.items() if item is not None and item != {}}
    if isinstance(value, np.ndarray):
        return known(value.tolist())
    if isinstance(value, Sequence) and not isinstance(value, str):
        return [known(item) for item in value]
    if isinstance(value, np.generic):
        return known(value.item())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


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


def write_json(result: Mapping[str, Any], path: Path) -> None:
    """Write a result to a file, indented; it is whole or not there."""
    write_text_aside(path, as_json(result, indent=2) + "\n")
