"""Where results go: looked at before any work begins, so that none is lost for want of a place."""

from __future__ import annotations

import os
import time
from pathlib import Path
from typing import Any

import click

from hil.errors import UsageError
from hil.reports.judged_log import made_folder


class OutputFile(click.Path):
    """A file to write; refused where it cannot be written."""

    def __init__(self) -> None:
        super().__init__(path_type=Path)

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """The path; raises :class:`UsageError` where nothing can be written there."""
        path = Path(os.fsdecode(super().convert(value, param, ctx)))
        refuse_unwritable(path, _option(param))
        return path


class OutputFolder(click.Path):
    """A folder for results, there or not; refused where it cannot be made or written to."""

    def __init__(self) -> None:
        super().__init__(path_type=Path)

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """The path; raises :class:`UsageError` where no folder can be."""
        path = Path(os.fsdecode(super().convert(value, param, ctx)))
        refuse_no_folder(path, _option(param))
        return path


def refuse_no_folder(path: Path, option: str) -> None:
    """Raise :class:`UsageError` where no folder for results can be; ``option``: what gave it."""
    nearest = path
    try:
        while not nearest.exists() and nearest != nearest.parent:
            nearest = nearest.parent
    except OSError as error:
        raise UsageError(f"{option} {path}: {error.strerror}; give another folder") from None
    if not nearest.is_dir():
        raise UsageError(f"{option} {path}: cannot be made ({nearest} is a file); give another folder")
    if not os.access(nearest, os.W_OK | os.X_OK):
        raise UsageError(f"{option} {path}: may not be written to; give another folder")


def refuse_unwritable(path: Path, option: str) -> None:
    """Raise :class:`UsageError` for a file that cannot be written; ``option``: what gave it."""
    try:
        if path.is_dir():
            raise UsageError(f"{option} {path}: cannot be written (it is a folder); give a file")
        there, folder = path.exists(), path.parent
        # Pipes and devices are there, and who may write to them may.
        if not there and not folder.is_dir():
            raise UsageError(
                f"{option} {path}: cannot be written (there is no folder {folder}); make it, or give another"
            )
    except OSError as error:
        raise UsageError(f"{option} {path}: cannot be written ({error.strerror}); give another") from None
    if not os.access(path if there else folder, os.W_OK if there else os.W_OK | os.X_OK):
        raise UsageError(f"{option} {path}: cannot be written (permission denied); give another file")


def new_folder(name: str) -> Path:
    """A folder of ``runs`` by a name and the time, made now: one that no other run has.

    Raises :class:`UsageError` if it cannot be made.
    """
    runs, stamp = made_folder(Path("runs")), time.strftime("%Y%m%d-%H%M%S")
    for number in range(1, 10_000):
        folder = runs / (f"{name}-{stamp}" if number == 1 else f"{name}-{stamp}-{number}")
        try:
            folder.mkdir()
        except FileExistsError:
            continue
        except OSError as error:
            raise UsageError(f"{folder}: cannot be made ({error.strerror}); give --out") from None
        return folder
    raise UsageError(f"{runs / name}-{stamp}: is taken, and thousands more beside it; give --out")


def _option(param: click.Parameter | None) -> str:
    return param.opts[0] if param is not None else "--out"
