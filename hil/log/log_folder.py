"""A folder of logs: which of what is in it are logs, and whether it is not one log itself, in pieces."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from hil.errors import UsageError
from hil.log.bag_folder import METADATA, SUFFIXES, in_order
from hil.log.description import RECORD
from hil.log.opened import opened_log
from hil.log.reader import Log

_PIECE = re.compile(r"(.+)_(\d+)")
"""Name of a piece of a log, without what it ends in."""
_LONGEST_PAUSE_NS = 10_000_000_000
"""Files of a stranger's that begin later than this after another's end are no parts of one recording."""


def logs_in(folder: Path) -> list[Path]:
    """The logs in a folder and in the folders in it, each a file or a folder that is one log, by their names.

    Just the folder itself if that is one log: a bag with its metadata, or pieces that are numbered behind the
    folder's name. Files of other names are parts of one log if they are a stranger's and numbered or of one
    time; those of abreast only if they are numbered, say the same of themselves, and follow each other.
    What begins with a dot is passed over, and what a symbolic link in it leads to if that is found without
    the link, or lies above it. Empty if there are none.
    """
    return _without_twins(_logs_in(folder, (folder.resolve(),)), folder)


def _logs_in(folder: Path, above: tuple[Path, ...]) -> list[Path]:
    """``above``: the folders that lead here, resolved, this one too."""
    seen = sorted((each for each in folder.iterdir() if not each.name.startswith(".")), key=in_order)
    files = _without_twins([each for each in seen if each.name.endswith(SUFFIXES) and each.is_file()], folder)
    if (folder / METADATA).exists() or (len(files) > 1 and _is_one(folder, files)):
        return [folder]
    within = [
        log
        for each in seen
        if each.is_dir() and not _leads_up(place := each.resolve(), above)
        for log in _logs_in(each, (*above, place))
    ]
    return [*files, *within]


def _leads_up(place: Path, above: Sequence[Path]) -> bool:
    return any(folder.is_relative_to(place) for folder in above)


def _without_twins(paths: Sequence[Path], folder: Path) -> list[Path]:
    """The same without what is found twice, or in a log that is a folder: the way without a link stays."""
    root = folder.resolve()
    places = {path: path.resolve() for path in paths}
    taken: dict[Path, Path] = {}
    for path in sorted(paths, key=lambda path: places[path] != root / path.relative_to(folder)):
        if taken.keys().isdisjoint((places[path], *places[path].parents)):
            taken[places[path]] = path
    return [path for path in paths if taken.get(places[path]) == path]


def is_folder_of_logs(path: Path) -> bool:
    """Whether a path is a folder that holds logs and is not one log itself."""
    if not path.is_dir():
        return False
    found = logs_in(path)
    return bool(found) and found != [path] and not (len(found) == 1 and found[0].parent == path)


def _is_one(folder: Path, files: Sequence[Path]) -> bool:
    """Whether several files are the pieces of one log."""
    named = [_PIECE.fullmatch(each.name.partition(".")[0]) for each in files]
    stems = {match[1] for match in named if match}
    numbered = all(named) and len(stems) == 1
    if numbered and stems == {folder.name}:
        return True
    first, second = map(_opened, files[:2])
    if first is None or second is None:
        return False
    between_ns = (second.start_ns or 0) - (first.end_ns or 0)
    if RECORD in first.metadata or RECORD in second.metadata:
        return numbered and between_ns > 0 and first.metadata.get(RECORD) == second.metadata.get(RECORD)
    return numbered or between_ns < _LONGEST_PAUSE_NS


def _opened(path: Path) -> Log | None:
    """A log, None if it cannot be read."""
    try:
        return opened_log(path)
    except UsageError:
        return None
