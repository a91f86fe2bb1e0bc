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
    What begins with a dot is passed over. Empty if there are none.
    """
    files = sorted(
        (each for each in folder.iterdir() if each.name.endswith(SUFFIXES) and each.is_file()), key=in_order
    )
    if (folder / METADATA).exists() or (len(files) > 1 and _is_one(folder, files)):
        return [folder]
    inner = (each for each in folder.iterdir() if each.is_dir() and not each.name.startswith("."))
    within = [log for each in sorted(inner, key=in_order) for log in logs_in(each)]
    return [*(each for each in files if not each.name.startswith(".")), *within]


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
