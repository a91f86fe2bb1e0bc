"""The folder of a bag: which files ``ros2 bag record`` left in it, and how they are compressed."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path, PurePath
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from hil.errors import UsageError

METADATA = "metadata.yaml"
SUFFIXES = (".mcap", ".db3", ".mcap.zstd", ".db3.zstd", ".mcap.zst", ".db3.zst", ".bag")


@dataclass(frozen=True, slots=True)
class BagFolder:
    """Files of a bag in their order; ``in_messages``: each message of them is compressed by itself."""

    path: Path
    parts: tuple[Path, ...]
    in_messages: bool = False


def bag_folder(path: Path) -> BagFolder:
    """What is in a bag's folder, by its ``metadata.yaml`` or, where a recorder left none, by the files.

    Raises :class:`UsageError` for a folder without a bag, and for one that lacks a file that it names.
    """
    there = sorted((each for each in path.iterdir() if each.name.endswith(SUFFIXES)), key=in_order)
    told = _told(path / METADATA)
    named = told.get("relative_file_paths") or []
    parts = [_there(path, name) for name in named] if isinstance(named, list) else []
    # A bag that grows, or whose recorder was killed, has files that its metadata do not name yet.
    parts += [each for each in there if each not in parts and not _is_packed(each, parts)]
    if not parts:
        raise UsageError(
            f"log {path}: is a folder without a bag; expected {METADATA} and files that end in "
            f"{', '.join(SUFFIXES)}, or give a file"
        )
    return BagFolder(path, tuple(parts), str(told.get("compression_mode", "")).lower() == "message")


def _told(path: Path) -> dict[str, Any]:
    try:
        tree = YAML(typ="safe").load(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return {}
    except (OSError, YAMLError, ValueError) as error:
        reason = " ".join(str(error).split())
        raise UsageError(f"log {path.parent}: its {METADATA} cannot be read ({reason}); remove it") from None
    told = tree.get("rosbag2_bagfile_information") if isinstance(tree, dict) else None
    return told if isinstance(told, dict) else {}


def _there(folder: Path, name: object) -> Path:
    """A file of a bag; older versions tell its path with the folder in front."""
    path = folder / PurePath(str(name)).name
    if path.exists():
        return path
    for suffix in (".zstd", ".zst"):
        if (packed := path.with_name(path.name + suffix)).exists():
            return packed
    if path.suffix in (".zstd", ".zst") and path.with_suffix("").exists():
        return path.with_suffix("")
    raise UsageError(
        f"log {folder}: lacks {path.name}, which its {METADATA} names; put it there, or take the name out"
    )


def _is_packed(path: Path, parts: list[Path]) -> bool:
    """Whether a file is the same as one of the parts, packed or unpacked."""
    return any(
        path.name in (part.name + ".zstd", part.name + ".zst") or part.stem == path.name for part in parts
    )


def in_order(path: Path) -> list[tuple[bool, int, str]]:
    """Sort key by which ``bag_10`` comes after ``bag_9``."""
    pieces = re.split(r"(\d+)", path.name)
    return [(piece.isdecimal(), int(piece) if piece.isdecimal() else 0, piece) for piece in pieces]
