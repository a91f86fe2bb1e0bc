"""What is installed by choice: which extra of abreast brings a library, and what to say where one is missing.

A test holds that each foreign module that is imported is one of the plain install or stands here.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec

from formation.kernel import compiles
from hil.errors import UsageError

EXTRA_OF = {
    "PIL": "report",
    "bokeh": "report",
    "matplotlib": "report",
    "pyarrow": "tables",
    "filterpy": "filterpy",
    "distributed": "cluster",
    "foxglove": "foxglove",
    "motioncapture": "mocap",
    "cryptography": "secure",
    "geometry_msgs": "ros",
    "rclpy": "ros",
}
"""The extra that brings a module, by the module's top-level name."""

LEFT_OUT = frozenset({"numba", "llvmlite", "scipy"})
"""Modules of the plain install that an install for daemons alone has not."""


def missing_extra(error: BaseException | None) -> str:
    """The extra that brings the module which an import did not find; empty if none of ours does.

    >>> missing_extra(ModuleNotFoundError(name="bokeh.palettes"))
    'report'
    """
    return EXTRA_OF.get(_top(error), "") if isinstance(error, ModuleNotFoundError) else ""


def is_left_out(error: ModuleNotFoundError) -> bool:
    """Whether what an import did not find is of ours: of an extra, or left out for daemons alone."""
    return bool(missing_extra(error)) or _top(error) in LEFT_OUT


def needs_extra(what: str, error: ModuleNotFoundError) -> UsageError:
    """The line for who asked for something that cannot be done without a library that is missing."""
    brings = f"pip install 'abreast[{missing_extra(error)}]'"
    if _top(error) in LEFT_OUT:
        brings = "pip install abreast in an environment that has no abreast-daemon"
    return UsageError(f"{what}: needs {_top(error)}, which is not installed; {brings}")


def _top(error: ImportError) -> str:
    return (error.name or "").partition(".")[0]


def why_interpreted() -> str:
    """Why nothing is compiled here; empty where it is."""
    if compiles():
        return ""
    return "ABREAST_INTERPRETED is set" if find_spec("numba") else "numba is not installed"


def begin_to_judge(command: str) -> None:
    """Say on stderr that a command which judges runs will be slow, where nothing is compiled.

    Raises :class:`UsageError` where daemons alone are installed, before anything drives.
    """
    if find_spec("scipy") is None:
        raise needs_extra(command, ModuleNotFoundError(name="scipy"))
    if why := why_interpreted():
        print(f"abreast {command}: interpreted, as {why}: it takes minutes", file=sys.stderr)  # noqa: T201


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
        print(f"no {what}: pip install 'abreast[{extra}]'", file=sys.stderr)  # noqa: T201
