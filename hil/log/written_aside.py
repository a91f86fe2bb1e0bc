"""Results that are whole or not there: written beside their place, and put there once they are on disk."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from hil.log.disk import FULL, no_room


@contextmanager
def written_aside(path: Path) -> Iterator[Path]:
    """A path to write in the place of this one, which gets what was written when the block ends.

    If the block raises, or the disk is full, nothing is left, and what was there before stays. A device or a
    pipe is written as it is. Raises :class:`~hil.errors.AbreastError` for a full disk, and OSError.
    """
    place = path.resolve()
    if place.exists() and not place.is_file():
        with _told(path, place):
            yield path
        return
    aside = place.with_name(f".{place.stem}.unfinished{place.suffix}")
    try:
        with _told(path, aside):
            yield aside
            with aside.open("rb+") as stream:
                os.fsync(stream.fileno())
            os.replace(aside, place)
    except BaseException:
        aside.unlink(missing_ok=True)
        raise


def write_text_aside(path: Path, text: str) -> None:
    """Write a text as UTF-8; raises as :func:`written_aside`."""
    with written_aside(path) as aside:
        aside.write_text(text, encoding="utf-8")


@contextmanager
def _told(path: Path, aside: Path) -> Iterator[None]:
    """Errors of the disk as those of the file that was to be written."""
    try:
        yield
    except OSError as error:
        if error.errno in FULL:
            raise no_room(path, error) from error
        if error.filename in (str(aside), aside):
            error.filename = str(path)
        raise
