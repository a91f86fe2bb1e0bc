"""Column maps: what the columns of a CSV recording mean.

A map is a TOML file. ``[columns]`` says where the measurement comes from: ``t``, then either ``rho`` and
``alpha2`` or both poses, and the follower's motion ``v2``, ``u2``, which its poses may tell instead. The
follower's heading is ``follower_theta`` or its quaternion. Without the section columns are known by their
names (:mod:`hil.recordings.known_columns`). ``[truth]`` says what is known of the true states. ``[scenario]``
has a ``base`` (name or path) and what differs from it: front end, noise, limits.
An entry is a column's name, or ``{ column, unit }``, or ``{ column, scale, offset }``, or ``{ constant }``.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import msgspec
from msgspec import Struct

from hil.errors import UsageError
from hil.recordings.units import factor_of, units_of
from hil.replay.topic_map import MAPS, needs_odometry
from hil.scenario.checked_toml import checked, locate, read_toml
from hil.scenario.files import Overrides, merged_scenario, with_overrides
from hil.scenario.schema import Scenario


class Source(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Where a quantity comes from: ``column`` times ``scale`` plus ``offset``, or a ``constant``.

    ``unit`` (mm, deg, ms) stands for the scale that makes SI units of it. With neither, the unit that the
    file tells of the column counts.
    """

    column: str | None = None
    constant: float | None = None
    scale: float | None = None
    offset: float = 0.0
    unit: str | None = None

    def factor(self, quantity: str, told: str | None = None) -> float:
        """What to multiply cells by; ``told``: the unit that the file tells."""
        if self.scale is not None:
            return self.scale
        unit = self.unit or told
        factor = None if unit is None else factor_of(quantity, unit)
        return 1.0 if factor is None else factor


Entry = str | Source


class Columns(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """What the estimator gets. Time [s], distances [m], angles [rad], speed [m/s], turn rate [rad/s]."""

    t: Entry
    v2: Entry | None = None
    u2: Entry | None = None
    rho: Entry | None = None
    alpha2: Entry | None = None
    leader_x: Entry | None = None
    leader_y: Entry | None = None
    leader_theta: Entry | None = None
    follower_x: Entry | None = None
    follower_y: Entry | None = None
    follower_theta: Entry | None = None
    leader_z: Entry | None = None
    leader_qx: Entry | None = None
    leader_qy: Entry | None = None
    leader_qz: Entry | None = None
    leader_qw: Entry | None = None
    follower_z: Entry | None = None
    follower_qx: Entry | None = None
    follower_qy: Entry | None = None
    follower_qz: Entry | None = None
    follower_qw: Entry | None = None


class TruthColumns(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """What is known of the true states; the rest stays unknown."""

    leader_x: Entry | None = None
    leader_y: Entry | None = None
    leader_theta: Entry | None = None
    v1: Entry | None = None
    u1: Entry | None = None
    follower_x: Entry | None = None
    follower_y: Entry | None = None
    follower_theta: Entry | None = None
    v2: Entry | None = None
    u2: Entry | None = None


class _File(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    columns: Columns | None = None
    truth: TruthColumns = TruthColumns()
    inputs: Literal["measured", "commanded"] = "measured"
    delimiter: str | None = None
    decimal: Literal[".", ","] | None = None
    up: Literal["y", "z"] = "z"
    scenario: dict[str, Any] = {}


@dataclass(frozen=True, slots=True)
class ColumnMap:
    """A column map with the scenario that it leads to.

    ``path``: None without a map. ``columns``, ``truth``: sources by quantity, only those that are given; no
    columns are if they are known by their names. ``commanded``: v2 and u2 of a row are commands that were
    sent after its measurement, so that the measurement cannot rest on them. ``delimiter``, ``decimal``: None
    to find them. ``up``: the axis that points up.
    """

    path: Path | None
    columns: dict[str, Source]
    truth: dict[str, Source]
    commanded: bool
    delimiter: str | None
    decimal: str | None
    up: str
    scenario: Scenario

    @property
    def name(self) -> str:
        """What messages call the map."""
        return f"map {self.path}" if self.path else "column names"

    @property
    def moved(self) -> bool:
        """Whether the follower's motion is measured by itself."""
        return "v2" in self.columns

    @property
    def sighted(self) -> bool:
        """Whether the leader is measured by range and bearing, not by poses of both."""
        return "rho" in self.columns


def no_map(name: str, scenario: str | None, overrides: Overrides = ()) -> ColumnMap:
    """What stands for a map of a recording ``name`` without one: columns are known by their names.

    ``scenario``: by name or path, the default base of maps without it. Raises :class:`UsageError` as
    :func:`hil.scenario.files.load_scenario`.
    """
    part = {} if scenario is None else {"base": scenario}
    made = with_overrides(merged_scenario(part, name, "--scenario"), overrides)
    return ColumnMap(None, {}, {}, False, None, None, "z", made)


def load_column_map(name_or_path: str, overrides: Overrides = ()) -> ColumnMap:
    """Read a column map by its shipped name or from a TOML file, with overrides of its scenario's keys.

    Raises :class:`UsageError` for a file that isn't there or not TOML, an unknown key (naming the nearest
    known one), a wrong value, or columns that don't make up a measurement.
    """
    path = locate("map", MAPS, name_or_path)
    source = f"map {path.stem}"
    tree = read_toml(path, "map")
    if "topics" in tree:
        raise UsageError(f"{source}: maps the topics of a log; take it to: abreast replay LOG --map {path}")
    file = checked(tree, _File, source)
    if file.delimiter is not None and len(file.delimiter) != 1:
        raise UsageError(
            f"{source}: delimiter is {file.delimiter!r}, expected one character, such as ',' or ';'"
        )
    chart = ColumnMap(
        path=path,
        columns=dict(_given(file.columns, f"{source}: columns")) if file.columns else {},
        truth=dict(_given(file.truth, f"{source}: truth")),
        commanded=file.inputs == "commanded",
        delimiter=file.delimiter,
        decimal=file.decimal,
        up=file.up,
        scenario=with_overrides(merged_scenario(file.scenario, path.stem, f"{source}: scenario"), overrides),
    )
    if chart.columns:
        check_columns(chart, source)
    return chart


def check_columns(chart: ColumnMap, source: str) -> None:
    """Raise :class:`UsageError`, beginning with ``source``, for columns that don't make up a measurement."""
    _check_measurement(chart, source)
    _check_motion(chart, source)


def _given(section: Struct, where: str) -> Iterator[tuple[str, Source]]:
    for name, entry in msgspec.structs.asdict(section).items():
        if entry is None:
            continue
        source = Source(column=entry) if isinstance(entry, str) else entry
        if (source.column is None) == (source.constant is None):
            raise UsageError(f"{where}.{name}: give either a column or a constant")
        if source.unit is not None and source.scale is not None:
            raise UsageError(f"{where}.{name}: give either a unit or a scale")
        if source.unit is not None and factor_of(name, source.unit) is None:
            raise UsageError(
                f"{where}.{name}: unit is {source.unit!r}, expected one of {', '.join(units_of(name))}"
            )
        yield name, source


def _check_measurement(chart: ColumnMap, source: str) -> None:
    sighting = {"rho", "alpha2"}
    turned = {f"follower_q{axis}" for axis in "xyzw"}
    poses = {"leader_x", "leader_y", "follower_x", "follower_y"}
    if chart.up == "y":
        poses |= {"leader_z", "follower_z"}
    poses |= turned if turned & set(chart.columns) or chart.up == "y" else {"follower_theta"}
    quaternion = {f"leader_q{axis}" for axis in "xyzw"}
    if 0 < len(quaternion & set(chart.columns)) < len(quaternion):
        poses |= quaternion
    has_sighting, has_poses = sighting & set(chart.columns), poses & set(chart.columns)
    if has_sighting and has_poses:
        raise UsageError(
            f"{source}: columns: give either rho and alpha2 or the poses; true poses go to [truth]"
        )
    wanted = sighting if has_sighting else poses
    missing = sorted(wanted - set(chart.columns))
    if missing and not has_sighting | has_poses:
        raise UsageError(
            f"{source}: columns: no measurement; give rho and alpha2, or {', '.join(sorted(poses))}"
        )
    if missing:
        raise UsageError(
            f"{source}: columns: {', '.join(missing)} missing; name a column or a constant for it"
        )
    if has_sighting and chart.scenario.estimator.front_end != "body":
        raise UsageError(
            f"{source}: range and bearing need the body front end; set scenario.estimator.front_end = 'body'"
        )


def _check_motion(chart: ColumnMap, source: str) -> None:
    missing = sorted({"v2", "u2"} - set(chart.columns))
    if len(missing) == 1:
        raise UsageError(
            f"{source}: columns: {missing[0]} missing; name a column or a constant for it, or leave out both"
        )
    if missing and (chart.sighted or needs_odometry(chart.scenario)):
        raise UsageError(
            f"{source}: columns: u2, v2 missing; name columns or constants for them, or give both poses "
            "and set scenario.estimator.own_motion = 'auto' or 'mocap'"
        )
