"""Every number of the schema, and values that no lab has."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, NamedTuple, get_args, get_origin

import msgspec

from hil.scenario.schema import Scenario

ABSURD = (0, -1, 1e300, -1e300, 1e-300, 5e-324, 10**22 - 1, 10**400, 1e9, "inf", "-inf", "nan")
"""Values that are given to every number in turn, besides the ends of its range."""


class Number(NamedTuple):
    """A number of the schema: its key, what has to be set for it to count, and its value as TOML around it.

    ``low``, ``high``: what the schema allows, both of which it must be able to run.
    """

    key: str
    given: tuple[str, ...]
    text: str
    low: float | None
    high: float | None

    @property
    def values(self) -> tuple[object, ...]:
        """All that it is given."""
        return (*ABSURD, *(each for each in (self.low, self.high) if each is not None))

    def override(self, value: object) -> str:
        """The override that gives it a value."""
        return f"{self.key}={self.text % value}"


FAULTS = {
    "mocap.faults": '[{kind = "step", at_s = 0.05, %s}]',
    "robot.odometry_faults": '[{kind = "delay", at_s = 0.05, %s}]',
}
PROGRAMS = {
    "constant": {"v": "0.1", "u": "0.1"},
    "sinusoid": {"v": "0.1", "u_mean": "0.0", "u_amplitude": "0.1", "omega": "1.0"},
    "impulse": {"v": "0.1", "u_amplitude": "0.1", "t_centre": "1.0", "t_width": "1.0"},
    "table": {"t": "[0.0, 1.0]", "v": "[0.1, 0.1]", "u": "[0.0, 0.0]"},
}


def numbers() -> Iterator[Number]:
    """All numbers of a scenario."""
    for section in msgspec.structs.fields(Scenario):
        for kind in _structs(section.type):
            for field in msgspec.structs.fields(kind):
                yield from _numbers_of(section.name, field)


def _numbers_of(section: str, field: msgspec.structs.FieldInfo) -> Iterator[Number]:
    key = f"{section}.{field.name}"
    given = ("chain.agents=3",) if section == "chain" else ("flock.agents=4",) if section == "flock" else ()
    if field.name == "program":
        yield from _of_programs(key)
    elif key in FAULTS:
        (kind,) = _structs(field.type)
        for inner in msgspec.structs.fields(kind):
            for place, (low, high) in enumerate(_leaves(inner.type)):
                pair = "[%s, 0.0]" if place == 0 else "[0.0, %s]"
                whole = FAULTS[key] % f"{inner.name} = {pair if _is_tuple(inner.type) else '%s'}"
                if inner.name == "at_s":
                    whole = whole.replace("at_s = 0.05, ", "")
                yield Number(key, given, whole, low, high)
    else:
        leaves = list(_leaves(field.type))
        for place, (low, high) in enumerate(leaves):
            if field.name == "parameters":
                yield Number(f"{key}.k", given, "%s", low, high)
            elif len(leaves) > 1:
                inside = ", ".join("%s" if k == place else "0.0" for k in range(len(leaves)))
                yield Number(key, given, f"[{inside}]", low, high)
            else:
                yield Number(key, given, "[%s]" if _is_tuple(field.type) else "%s", low, high)


def _of_programs(key: str) -> Iterator[Number]:
    field = next(f for f in msgspec.structs.fields(_section("leader")) if f.name == "program")
    for kind in _structs(field.type):
        name = str(kind.__struct_config__.tag)
        for inner in msgspec.structs.fields(kind):
            ((low, high),) = _leaves(inner.type)
            usual = PROGRAMS[name]
            value = "[%s, 1.0]" if name == "table" else "%s"
            body = ", ".join(f"{k} = {value if k == inner.name else v}" for k, v in usual.items())
            yield Number(key, (), f'{{kind = "{name}", {body}}}', low, high)


def _section(name: str) -> type[msgspec.Struct]:
    (kind,) = next(_structs(f.type) for f in msgspec.structs.fields(Scenario) if f.name == name)
    return kind


def _structs(kind: Any) -> list[type[msgspec.Struct]]:
    if isinstance(kind, type) and issubclass(kind, msgspec.Struct):
        return [kind]
    return [each for inner in get_args(kind) for each in _structs(inner)]


def _is_tuple(kind: Any) -> bool:
    return get_origin(kind) in (tuple, list)


def _leaves(kind: Any) -> Iterator[tuple[float | None, float | None]]:
    """Bounds of every number that a type has, in their order."""
    if kind in (float, int):
        yield None, None
    elif get_origin(kind) is Annotated:
        inner, *metas = get_args(kind)
        for _ in _leaves(inner):
            meta = next(each for each in metas if isinstance(each, msgspec.Meta))
            yield meta.ge, meta.le
    elif not _structs(kind) and kind not in (str, bool):
        for inner in get_args(kind):
            if inner is not Ellipsis and not isinstance(inner, str):
                yield from _leaves(inner)
