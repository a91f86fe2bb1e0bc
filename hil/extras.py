"""What is installed by choice: which extra of abreast brings a library, and what to say where one is missing.

A test holds that each foreign module that is imported is one of the plain install or stands here.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager

from hil.errors import UsageError

EXTRA_OF = {
    "PIL": "report",
    "bokeh": "report",
    "matplotlib": "report",
    "pyarrow": "tables",
    "filterpy": "filterpy",
    "distributed": "cluster",
    "motioncapture": "mocap",
    "cryptography": "secure",
    "geometry_msgs": "ros",
    "rclpy": "ros",
}
"""The extra that brings a module, by the module's top-level name."""

LEFT_OUT = frozenset({"numba", "llvmlite", "scipy"})
"""Modules of the plain install that an install for daemons alone has not."""


def missing_extra(error: BaseException | None) -> str:
    """What brings the module that an import did not find, as pip takes it; empty if none of ours does.

    >>> missing_extra(ModuleNotFoundError(name="bokeh.palettes"))
    'abreast[report]'
    """
    if not isinstance(error, ModuleNotFoundError):
        return ""
    name = (error.name or "").partition(".")[0]
    if name in LEFT_OUT:
        return "abreast"
    return f"abreast[{EXTRA_OF[name]}]" if name in EXTRA_OF else ""


def needs_extra(what: str, error: ModuleNotFoundError) -> UsageError:
    """The line for who asked for something that cannot be done without a library that is missing."""
    return UsageError(
        f"{what}: needs {error.name}, which is not installed; pip install '{missing_extra(error)}'"
    )


@contextmanager
def left_out_if_missing(what: str) -> Iterator[None]:
    """Go on without ``what`` where the extra that makes it is not installed, and say so on stderr.

    All else that is not found is raised as it is.
    """
    try:
        yield
    except ModuleNotFoundError as error:
        if not (extra := missing_extra(error)):
            raise
        print(f"no {what}: pip install '{extra}'", file=sys.stderr)  # noqa: T201
