"""TOML files against a schema: each mistake is answered by one line that helps to correct it."""

from __future__ import annotations

import contextlib
import difflib
import math
import re
import tomllib
import unicodedata
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar, get_args

import msgspec

from hil.errors import UsageError
from hil.scenario.kinds_of_key import is_section, literals
from hil.scenario.table_examples import example_of, kind_meant

T = TypeVar("T", bound=msgspec.Struct)

LARGEST = 1e12
"""No number of a lab is above this, and squares of larger ones lose their meaning."""

_LARGEST_INTEGER = 2**63 - 1  # that TOML holds

_UNKNOWN = re.compile(r"unknown field `(?P<key>[^`]*)`(?: - at `\$\.?(?P<path>[^`]*)`)?")
_AT = re.compile(r"^(?P<what>.*?)(?: - at `\$\.?(?P<path>[^`]*)`)?$", re.DOTALL)


def data_folder() -> Path:
    """Folder of ``scenarios`` and ``maps``: inside an installed wheel, or at the top of a checkout."""
    package = Path(__file__).resolve().parents[1]
    installed = package / "data"
    return installed if installed.is_dir() else package.parent / "data"


def shipped_names(folder: str) -> list[str]:
    """Names of the TOML files that abreast ships in a folder of :func:`data_folder`, sorted."""
    return sorted(path.stem for path in (data_folder() / folder).glob("*.toml"))


def locate(noun: str, folder: str, name_or_path: str) -> Path:
    """Path of a shipped file by its name, or of the user's own; :class:`UsageError` if there is neither.

    ``noun`` is what the messages call such a file, ``folder`` where the shipped ones are.
    """
    for path in (data_folder() / folder / f"{name_or_path}.toml", Path(name_or_path)):
        # A name may be too long for the system, or hold what no path may.
        with contextlib.suppress(OSError, ValueError):
            if path.is_file():
                return path
    names = shipped_names(folder)
    hint = meant(name_or_path, names) or f"; give a TOML file or one of: {', '.join(names)}"
    raise UsageError(f"{noun} {name_or_path!r}: no such name and no such file{hint}")


def read_toml(path: Path, noun: str) -> dict[str, Any]:
    """Tree of plain values of a TOML file; :class:`UsageError` if it isn't readable as such."""
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise UsageError(f"{noun} {path}: not readable as TOML ({error}); correct the file") from error


def checked(tree: Mapping[str, Any], kind: type[T], source: str) -> T:
    """Turn a tree of plain values into a struct of the given kind.

    Raises :class:`UsageError`, beginning with ``source``, for an unknown key (naming the nearest known one),
    a wrong type, a value out of range or a number that isn't finite or above :data:`LARGEST`.
    """
    try:
        _refuse_above(math.inf, tree, source, "")
        result = msgspec.convert(tree, kind)
        # Only now, as a key's own range says more.
        _refuse_above(LARGEST, msgspec.to_builtins(result), source, "")
        return result
    except RecursionError:
        raise UsageError(f"{source}: sections nested too deeply; leave out what does not belong") from None
    except msgspec.ValidationError as error:
        raise UsageError(f"{source}: {_explain(str(error), tree, kind)}") from None


def nearest(word: str, known: Iterable[str]) -> str:
    """Hint at what could be meant by a word that is not among the known ones."""
    names = list(known)
    near = difflib.get_close_matches(word, names, n=1, cutoff=0.4)
    return f"did you mean {near[0]!r}?" if near else f"known here: {', '.join(names)}"


def meant(word: str, known: Iterable[str]) -> str:
    """``; did you mean 'this'?``, or nothing where no known word is near."""
    near = difflib.get_close_matches(word, list(known), n=1)
    return f"; did you mean {near[0]!r}?" if near else ""


def _refuse_above(largest: float, node: object, source: str, path: str) -> None:
    if isinstance(node, Mapping):
        for key, value in node.items():
            _refuse_above(largest, key, source, f"a key of {path or 'the top level'}")
            _refuse_above(largest, value, source, f"{path}.{key}" if path else str(key))
    elif isinstance(node, Sequence) and not isinstance(node, str):
        for value in node:
            _refuse_above(largest, value, source, path)
    elif isinstance(node, str) and not _is_text(node):
        shown = ascii(node[:40])
        raise UsageError(f"{source}: {path} is {shown}, expected text without control characters")
    elif isinstance(node, int) and abs(node) > _LARGEST_INTEGER:
        digits = int(math.log10(abs(node))) + 1
        raise UsageError(f"{source}: {path} is a number of {digits} digits, expected one up to {LARGEST:g}")
    elif isinstance(node, float) and not math.isfinite(node):
        raise UsageError(f"{source}: {path} is {node}, expected a finite number")
    elif isinstance(node, float) and abs(node) > largest:
        raise UsageError(f"{source}: {path} is {node:g}, expected a number up to {largest:g}")


def _is_text(given: str) -> bool:
    """Whether a text can be written down and read again, line ends and tabs included."""
    return not any(unicodedata.category(each) in ("Cc", "Cs") and each not in "\n\t\r" for each in given)


def _explain(error: str, tree: Mapping[str, Any], kind: type[msgspec.Struct]) -> str:
    unknown = _UNKNOWN.search(error)
    if unknown:
        section = unknown["path"] or ""
        known = _known_keys(section, tree, kind)
        where = f"[{section}] has an" if section else "there is an"
        hint = kind_meant(unknown["key"], kind) or nearest(unknown["key"], known)
        return f"{where} unknown key {unknown['key']!r}; {hint}"
    parts = _AT.match(error)
    if parts is None:
        return error
    path = parts["path"] or ""
    value: Any = tree
    for step in path.split(".") if path else []:
        value = _below(value, step)
    what = parts["what"].replace("`", "").replace("Expected", "expected").replace("Object missing", "missing")
    what = what.replace("expected object, got", "expected a section, got")
    allowed = _allowed(path, tree, kind) if what.startswith("Invalid") else []
    if allowed:
        near = meant(value, map(str, allowed)) if isinstance(value, str) else ""
        what = f"expected one of {', '.join(map(repr, allowed))}{near}"
    what = _with_example(what, path, tree, kind)
    shown = f" is {value!r}:" if path and not isinstance(value, Mapping) and value is not None else ":"
    return f"{path or 'top level'}{shown} {what}"


def _with_example(what: str, path: str, tree: Mapping[str, Any], kind: type[msgspec.Struct]) -> str:
    """What is wrong at a path, with an example where a list of tables is to be."""
    _, tables = _walk(path, tree, kind)
    examples = filter(None, (example_of(path.partition("[")[0], each) for each in tables))
    example = next(examples, "")
    return (
        f"{what.replace('expected array', 'expected a list of tables')}; as in {example}" if example else what
    )


def _known_keys(section: str, tree: Mapping[str, Any], kind: type[msgspec.Struct]) -> list[str]:
    """Keys that the section of the given dotted path may have."""
    node, sections = _walk(section, tree, kind)
    tag = node.get("kind") if isinstance(node, Mapping) else None
    sections.sort(key=lambda option: option.__struct_config__.tag != tag)
    return [field.name for option in sections[:1] for field in msgspec.structs.fields(option)]


def _allowed(path: str, tree: Mapping[str, Any], kind: type[msgspec.Struct]) -> list[object]:
    """Values that the key of the given dotted path may have, where there are only so many."""
    section, _, key = path.rpartition(".")
    _, options = _walk(section, tree, kind)
    tags = [o.__struct_config__.tag for o in options if o.__struct_config__.tag_field == key]
    fields = [field for option in options for field in msgspec.structs.fields(option) if field.name == key]
    return [*tags] or [value for field in fields for value in literals(field.type)]


def _walk(
    path: str, tree: Mapping[str, Any], kind: type[msgspec.Struct]
) -> tuple[object, list[type[msgspec.Struct]]]:
    """Value at a dotted path, and the kinds of section that may stand there; none if it is no section."""
    node: object = tree
    options: list[type[msgspec.Struct]] = [kind]
    for step in path.split(".") if path else []:
        node = _below(node, step)
        fields = [field for option in options for field in msgspec.structs.fields(option)]
        types = [field.type for field in fields if field.name == step.partition("[")[0]]
        options = [option for given in types for option in (given, *get_args(given)) if is_section(option)]
    return node, options


def _below(node: object, step: str) -> Any:
    """Value one step down a path as msgspec writes it: ``key``, or ``key[3]`` for an item of a list."""
    key, *places = step.replace("]", "").split("[")
    value = node.get(key) if isinstance(node, Mapping) else None
    for place in places:
        in_list = isinstance(value, Sequence) and place.isdecimal() and int(place) < len(value)
        value = value[int(place)] if in_list and isinstance(value, Sequence) else None
    return value
