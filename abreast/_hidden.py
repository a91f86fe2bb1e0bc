"""Packages of abreast that something of the same name hides, told before anything fails on them."""

from __future__ import annotations

import importlib.util
from collections.abc import Iterator
from pathlib import Path

PACKAGES = ("formation", "controllers", "estimation", "hil")
"""What lies beside this package and is imported by it, by names that others may use too."""


class HiddenPackageError(ImportError):
    """One of our packages cannot be imported, as something else has its name and comes first."""


def refuse_hidden() -> None:
    """Raise :class:`HiddenPackageError`, one line, if another package or module stands before one of ours."""
    for name, path in _hidden():
        raise HiddenPackageError(
            f"{path} hides abreast's package {name!r}: rename it, or start where {path.parent} is not on "
            "Python's path (PYTHONPATH, the current folder)",
            name=name,
            path=str(path),
        )


def _hidden() -> Iterator[tuple[str, Path]]:
    """Names of ours, each with what is found in its place."""
    beside = Path(__file__).resolve().parent.parent
    for name in PACKAGES:
        spec = importlib.util.find_spec(name)
        if spec is None or spec.origin is None:
            continue
        found = Path(spec.origin)
        if found.resolve() != beside / name / "__init__.py":
            yield name, found.parent if found.name == "__init__.py" else found
