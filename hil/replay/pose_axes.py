"""Which way is up in a track of poses, and in what unit it is, as far as robots on a floor tell."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Literal, NamedTuple

import numpy as np

from hil.nodes.findings import Findings
from hil.wire.pose_sources import NamedPlace

_FLAT = 0.1
"""Share of the way on the floor that a height may vary by."""

_SHORTEST_WAY_M = 0.02
_FARTHEST_M = 100.0
"""Apart, robots side by side are nearer than that, in millimetres farther."""

_MILLIMETRES = 0.001


class Axes(NamedTuple):
    """``up``: the axis that points up, None if the track does not tell; ``scale``: of its unit in metres."""

    up: Literal["x", "y", "z"] | None
    scale: float


def axes_of(messages: Iterable[Iterable[NamedPlace]]) -> Axes:
    """Axes of poses, by messages: robots drive on a floor, so the axis along which they do not move is up."""
    tracks: dict[str, list[tuple[float, float, float]]] = {}
    for places in messages:
        for each in places:
            tracks.setdefault(each.body, []).append((each.place.x, each.place.y, each.place.z))
    finite = {body: np.array(track) for body, track in tracks.items()}
    finite = {body: track[np.isfinite(track).all(axis=1)] for body, track in finite.items()}
    some = [track for track in finite.values() if len(track)]
    if not some:
        return Axes(None, 1.0)
    middles = np.array([np.median(track, axis=0) for track in some])
    apart = float(np.max(np.linalg.norm(middles - middles[0], axis=1)))
    scale = _MILLIMETRES if apart > _FARTHEST_M else 1.0
    # Of a track the most part, since a body that is lost may jump.
    extents = np.max([np.ptp(np.quantile(track, [0.02, 0.98], axis=0), axis=0) for track in some], axis=0)
    least, middle, _ = np.sort(extents)
    if least > _FLAT * middle or middle * scale < _SHORTEST_WAY_M:
        return Axes(None, scale)
    names: tuple[Literal["x"], Literal["y"], Literal["z"]] = ("x", "y", "z")
    return Axes(names[int(np.argmin(extents))], scale)


def axes_findings(messages: Iterable[Iterable[NamedPlace]]) -> Findings:
    """What is wrong with axes and unit of poses that were to have z up and be in metres."""
    found: dict[str, str] = {}
    axes = axes_of(messages)
    if axes.up not in (None, "z"):
        found["axes"] = (
            f"bodies keep their {axes.up} and move along z: {axes.up} seems to point up, expected z; "
            'set up = "y" under [topics] of the map'
        )
    if axes.scale != 1.0:
        found["unit"] = (
            "bodies are hundreds of metres apart: lengths seem to be in millimetres; "
            f"set scale = {axes.scale:g} under [topics] of the map"
        )
    return found
