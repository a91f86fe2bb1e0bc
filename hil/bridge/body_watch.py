"""What a bridge has seen of late: which bodies, and how late; for diagnostics and the console."""

from __future__ import annotations

import statistics
from collections import deque
from collections.abc import Sequence

from hil.bridge.seen_frame import SeenFrame, Up, place_of
from hil.nodes.findings import named_findings
from hil.nodes.frame_findings import axes_text
from hil.nodes.frame_looks import KEPT_NS, LOOK_NS
from hil.wire.pose_sources import upright
from hil.wire.records import Placement

_RECENT_NS = 500_000_000
_SHOWN = 8


class BodyWatch:
    """Folds in frames by :meth:`see`. ``wanted``: names of the bodies that the scenario asks for."""

    def __init__(self, wanted: Sequence[str], up: Up) -> None:
        self.wanted = tuple(wanted)
        self.untracked = 0
        self.not_finite = 0
        self._up = up
        self._tracks: dict[str, deque[tuple[int, Placement]]] = {}
        self._seen: dict[str, int] = {}
        self._in_frames: dict[str, int] = {}
        self._frame_ns = 0
        self._delays: list[int] = []

    def see(self, frame: SeenFrame, names: Sequence[str]) -> None:
        """Take in a frame whose bodies have these names."""
        self._frame_ns = frame.arrived_ns
        self._delays.append(frame.arrived_ns - frame.capture_ns)
        for name, body in zip(names, frame.bodies, strict=True):
            self._in_frames[name] = frame.arrived_ns
            if not body.tracked:
                self.untracked += 1
            elif not body.placed:
                self.not_finite += 1
            else:
                self._seen[name] = frame.arrived_ns
                if name in self.wanted:
                    self._track(name, frame.arrived_ns, upright(place_of(body), self._up, 1.0))

    def sees_frames(self, now_ns: int) -> bool:
        """Whether a frame has come of late."""
        return now_ns - self._frame_ns < _RECENT_NS

    def state(self, now_ns: int) -> str:
        """Which bodies are seen, of those wanted, and what is wrong with the others, in one line."""
        if not self.sees_frames(now_ns):
            return "waiting for frames"
        seen = self._recent(self._seen, now_ns)
        missing = [name for name in self.wanted if name not in seen]
        if not missing:
            return f"sees {_listed(self.wanted)}"
        there = self._recent(self._in_frames, now_ns)
        lost = [name for name in missing if name in there]
        unknown = [name for name in missing if name not in there]
        parts = [f"waiting for {_listed(lost)}, which the motion capture does not see"] if lost else []
        if unknown:
            others = [name for name in there if name not in self.wanted]
            parts.append(
                f"waiting for {_listed(unknown)}; in its frames are {_listed(others) or 'no others'}"
            )
        return "; ".join(parts)

    def findings(self, now_ns: int) -> dict[str, str]:
        """What is wrong, by the names of findings."""
        tracks = {name: [place for _, place in track] for name, track in self._tracks.items()}
        axes = "; ".join(filter(None, (axes_text(name, track) for name, track in tracks.items())))
        found = {"axes": f"by {self._up} up, as told, {axes}"} if axes else {}
        there = self._recent(self._in_frames, now_ns)
        missing = [name for name in self.wanted if name not in there]
        if missing and self.sees_frames(now_ns):
            found["bodies"] = f"wanted {_listed(missing)}, in the frames are {_listed(there) or 'none'}"
        return found

    def values(self, now_ns: int) -> dict[str, object]:
        """Values for a diagnostics message, and begin to measure delays anew."""
        values: dict[str, object] = {
            "bodies.seen": ", ".join(self._recent(self._seen, now_ns)),
            "bodies.wanted": ", ".join(self.wanted),
            "bodies.untracked": self.untracked,
            "bodies.not_finite": self.not_finite,
        }
        if self._delays:
            values["delay_ms"] = f"{statistics.median(self._delays) * 1e-6:.3f}"
            values["delay_spread_ms"] = f"{(max(self._delays) - min(self._delays)) * 1e-6:.3f}"
            self._delays.clear()
        return values | named_findings(self.findings(now_ns))

    def _track(self, name: str, at_ns: int, place: Placement) -> None:
        """Keep where a body is, now and then."""
        track = self._tracks.setdefault(name, deque())
        if not track or not 0 <= at_ns - track[-1][0] < LOOK_NS:
            track.append((at_ns, place))
        while abs(at_ns - track[0][0]) > KEPT_NS:
            track.popleft()

    def _recent(self, when_ns: dict[str, int], now_ns: int) -> list[str]:
        return [name for name, at_ns in when_ns.items() if now_ns - at_ns < _RECENT_NS]


def _listed(names: Sequence[str]) -> str:
    shown = ", ".join(repr(name) for name in names[:_SHOWN])
    return f"{shown} and {len(names) - _SHOWN} more" if len(names) > _SHOWN else shown
