"""Reading scenarios: by name or path, with overrides, each mistake answered by one line that helps."""

from __future__ import annotations

import difflib
import math
import re
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import msgspec
import tomli_w

from hil.errors import UsageError
from hil.scenario import Scenario

_UNKNOWN = re.compile(r"unknown field `(?P<key>[^`]*)`(?: - at `\$\.?(?P<path>[^`]*)`)?")
_AT = re.compile(r"^(?P<what>.*?)(?: - at `\$\.?(?P<path>[^`]*)`)?$", re.DOTALL)


def data_folder() -> Path:
    """Folder of ``scenarios`` and ``maps``: inside an installed wheel, or at the top of a checkout."""
    here = Path(__file__).resolve().parent
    installed = here / "data"
    return installed if installed.is_dir() else here.parent / "data"


def scenario_names() -> list[str]:
    """Names of the scenarios that abreast ships, sorted."""
    return sorted(path.stem for path in (data_folder() / "scenarios").glob("*.toml"))


def load_scenario(name_or_path: str, overrides: Iterable[str] = ()) -> Scenario:
    """Read a scenario by its shipped name or from a TOML file, then apply ``section.key=value`` overrides.

    Raises :class:`UsageError` for an unknown name, unreadable TOML, an unknown key (naming the nearest known
    one), a wrong type, or a value out of range.
    """
    path = _locate(name_or_path)
    try:
        tree = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise UsageError(f"scenario {path}: not readable as TOML ({error}); correct the file") from error
    tree.setdefault("name", path.stem)
    return build_scenario(tree, overrides, source=f"scenario {path.stem}")


def build_scenario(
    tree: Mapping[str, Any], overrides: Iterable[str] = (), source: str = "scenario"
) -> Scenario:
    """Check a tree of plain values (as TOML gives) and turn it into a :class:`Scenario`."""
    merged = msgspec.to_builtins(tree)
    for override in overrides:
        _apply(merged, override)
    _refuse_non_finite(merged, source, "")
    try:
        return msgspec.convert(merged, Scenario)
    except msgspec.ValidationError as error:
        raise UsageError(f"{source}: {_explain(str(error), merged)}") from None


def scenario_text(scenario: Scenario) -> str:
    """Render the scenario, defaults included, as TOML that :func:`load_scenario` reads back unchanged."""
    return tomli_w.dumps(msgspec.to_builtins(scenario))


def with_overrides(scenario: Scenario, overrides: Iterable[str]) -> Scenario:
    """Return the scenario with ``section.key=value`` overrides applied and checked."""
    return build_scenario(msgspec.to_builtins(scenario), overrides, source=f"scenario {scenario.name}")


def _locate(name_or_path: str) -> Path:
    shipped = data_folder() / "scenarios" / f"{name_or_path}.toml"
    if shipped.is_file():
        return shipped
    path = Path(name_or_path)
    if path.is_file():
        return path
    names = scenario_names()
    near = difflib.get_close_matches(name_or_path, names, n=1)
    hint = f"; did you mean {near[0]!r}?" if near else f"; give a TOML file or one of: {', '.join(names)}"
    raise UsageError(f"scenario {name_or_path!r}: no such name and no such file{hint}")


def _apply(tree: dict[str, Any], override: str) -> None:
    key, equals, text = override.partition("=")
    steps = [step.strip() for step in key.split(".")]
    if not equals or not all(steps):
        raise UsageError(f"--set {override!r}: expected section.key=value, for example mocap.loss=0.05")
    try:
        value = tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        value = text.strip()
    node: Any = tree
    for step in steps[:-1]:
        node = node.setdefault(step, {})
        if not isinstance(node, dict):
            raise UsageError(f"--set {override!r}: {step!r} is a value and has no keys below it")
    node[steps[-1]] = value


def _refuse_non_finite(node: object, source: str, path: str) -> None:
    if isinstance(node, Mapping):
        for key, value in node.items():
            _refuse_non_finite(value, source, f"{path}.{key}" if path else str(key))
    elif isinstance(node, Sequence) and not isinstance(node, str):
        for value in node:
            _refuse_non_finite(value, source, path)
    elif isinstance(node, float) and not math.isfinite(node):
        raise UsageError(f"{source}: {path} is {node}, expected a finite number")


def _explain(error: str, tree: Mapping[str, Any]) -> str:
    unknown = _UNKNOWN.search(error)
    if unknown:
        section = unknown["path"] or ""
        known = _known_keys(section, tree)
        near = difflib.get_close_matches(unknown["key"], known, n=1, cutoff=0.4)
        hint = f"did you mean {near[0]!r}?" if near else f"known here: {', '.join(known)}"
        where = f"[{section}] has an" if section else "there is an"
        return f"{where} unknown key {unknown['key']!r}; {hint}"
    parts = _AT.match(error)
    if parts is None:
        return error
    path = parts["path"] or ""
    value: Any = tree
    for step in path.split(".") if path else []:
        value = value.get(step) if isinstance(value, Mapping) else None
    what = parts["what"].replace("`", "").replace("Expected", "expected").replace("Object missing", "missing")
    shown = f" is {value!r}:" if path and not isinstance(value, Mapping) and value is not None else ":"
    return f"{path or 'top level'}{shown} {what}"


def _known_keys(section: str, tree: Mapping[str, Any]) -> list[str]:
    """Keys that the section of the given dotted path may have."""
    kind: Any = Scenario
    node: Any = tree
    for step in section.split(".") if section else []:
        node = node.get(step, {}) if isinstance(node, Mapping) else {}
        kind = next(field.type for field in msgspec.structs.fields(kind) if field.name == step)
        options = getattr(kind, "__args__", ())
        if options:
            tag = node.get("kind") if isinstance(node, Mapping) else None
            kind = next((option for option in options if option.__struct_config__.tag == tag), options[0])
    return [field.name for field in msgspec.structs.fields(kind)]
