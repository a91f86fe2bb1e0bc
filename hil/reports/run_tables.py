"""The figures of a summary as tables; whatever else a summary holds is listed under its own name."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from math import degrees
from typing import Any

from hil.reports.intervals import TimeInterval
from hil.reports.page import table_html

QUANTITIES = {
    "v1": ("v₁", "mm/s"),
    "alpha1": ("α₁", "deg"),
    "rho_dot": ("ρ̇", "mm/s"),
    "alpha2_dot": ("α̇₂", "deg/s"),
    "u1": ("u₁", "deg/s"),
}
"""Symbol and unit in tables of every estimated quantity."""
_FORMS = {"extended": "{}_extended", "sound": "{}", "as in the paper": "paper_{}"}
_BOUNDED = {"v1": "v₁", "alpha1": "α₁", "h": "h"}
_SCALARS = (
    ("estimation.evaluated_from_s", "judged from", "s", 1.0),
    ("estimation.untracked", "did not say tracking", "", 1.0),
    ("estimation.settle_s", "settled after", "s", 1.0),
    ("estimation.nis_mean", "mean NIS (2 expected)", "", 1.0),
    ("bounds.M_rho", "largest error of ρ̇ seen, M_rho", "mm/s", 1e3),
    ("bounds.M_alpha2", "largest error of α̇₂ seen, M_alpha2", "deg/s", degrees(1.0)),
    ("bounds.v_eps", "leader's least speed, v_eps", "mm/s", 1e3),
    ("bounds.published.median.v1", "published bound of v₁, median", "mm/s", 1e3),
    ("bounds.published.median.alpha1", "published bound of α₁, median", "deg", degrees(1.0)),
    ("bounds.published.median.h", "published bound of h, median", "rad/s", 1.0),
    ("bounds.published.violations.v1", "v₁ outside its published bound", "", 1.0),
    ("bounds.published.violations.alpha1", "α₁ outside its published bound", "", 1.0),
    ("bounds.published.violations.h", "h outside its published bound", "", 1.0),
    ("formation.rho_min", "ρ, least", "m", 1.0),
    ("formation.rho_max", "ρ, largest", "m", 1.0),
    ("formation.rho_final", "ρ at the end", "m", 1.0),
    ("formation.alpha1_final", "α₁ at the end", "deg", degrees(1.0)),
    ("formation.alpha2_final", "α₂ at the end", "deg", degrees(1.0)),
    ("formation.equilibrium_deviation_rms.rho", "ρ off ρ₀, RMS", "mm", 1e3),
    ("formation.equilibrium_deviation_rms.alpha1", "α₁ off its station, RMS", "deg", degrees(1.0)),
    ("formation.orbit_deviation_rms.rho", "ρ off the noise-free run, RMS", "mm", 1e3),
    ("formation.orbit_deviation_rms.alpha1", "α₁ off the noise-free run, RMS", "deg", degrees(1.0)),
    ("certified.certified", "certified", "", 1.0),
    ("certified.v1.median", "radius of v₁, median", "mm/s", 1e3),
    ("certified.v1.largest", "radius of v₁, largest", "mm/s", 1e3),
    ("certified.v1.tightness", "largest error / radius of v₁", "", 1.0),
    ("certified.v1.violations", "v₁ outside its radius", "", 1.0),
    ("certified.alpha1.median", "radius of α₁, median", "deg", degrees(1.0)),
    ("certified.alpha1.largest", "radius of α₁, largest", "deg", degrees(1.0)),
    ("certified.alpha1.tightness", "largest error / radius of α₁", "", 1.0),
    ("certified.alpha1.violations", "α₁ outside its radius", "", 1.0),
    ("latency_ms.capture_to_command.p50", "capture to command, median", "ms", 1.0),
    ("latency_ms.capture_to_command.p99", "capture to command, 99 %", "ms", 1.0),
    ("latency_ms.capture_to_command.max", "capture to command, largest", "ms", 1.0),
)
_COUNTS = {
    "estimation": "Estimates",
    "bounds": "Bounds",
    "formation": "Formation",
    "certified": "Certified estimates",
    "latency_ms": "Latency",
}
_MOST_STOPS = 20
_Columns = Mapping[str, tuple[str, Callable[[Any], str]]]
_CERTIFICATE, _WORDS = "certificate", ("why", "assumes")
_HEAD = (
    "scenario",
    "seed",
    "mode",
    "estimator",
    "law",
    "duration_s",
    "log.path",
    "log.messages",
    "log.bytes",
    "findings",
)
"""What the head of the page says."""


def summary_tables(summary: Mapping[str, Any]) -> str:
    """Tables of all figures of a summary, with units; what the summary lacks is not there."""
    left = dict(_leaves(summary, ""))
    for name in _HEAD:
        left.pop(name, None)
    tables = [*_estimates(left), _bounds(left)]
    for group, caption in _COUNTS.items():
        rows = [
            (label, _number(scale * left.pop(path)), unit)
            for path, label, unit, scale in _SCALARS
            if path in left and path.startswith(group)
        ]
        tables.append(table_html(caption, ("", "value", "unit"), rows))
    for group, caption in (("frames", "Frames"), ("commands", "Commands"), ("rejected", "Inputs refused")):
        counts = [
            (path.partition(".")[2].replace("_", " "), _text(left.pop(path)))
            for path in list(left)
            if path.startswith(f"{group}.")
        ]
        tables.append(table_html(caption, ("", "count"), counts))
    guaranteed = _certificate(left)
    rest = [(path, _text(value)) for path, value in left.items()]
    further = table_html("By their names in summary.json, in SI units", ("", "value"), rest, long=True)
    return (
        '<div class="tables">\n'
        + "\n".join(filter(None, tables))
        + f"\n</div>\n{guaranteed}"
        + (f"<details><summary>Further figures</summary>{further}</details>" if rest else "")
    )


def stops_table(stops: Sequence[TimeInterval]) -> str:
    """When and why the robot was told to stand still; the longest if there are many."""
    longest = sorted(stops, key=lambda interval: interval.from_s - interval.to_s)[:_MOST_STOPS]
    rows = [
        (interval.what, f"{interval.from_s:.2f}", f"{interval.to_s:.2f}", str(interval.count))
        for interval in sorted(longest, key=lambda interval: interval.from_s)
    ]
    more = f"; the {_MOST_STOPS} longest of {len(stops)}" if len(stops) > _MOST_STOPS else ""
    return table_html(f"Told to stand still{more}", ("reason", "from [s]", "to [s]", "commands"), rows)


def scale_of(quantity: str) -> float:
    """What a quantity in SI units is multiplied by to be in the unit of :data:`QUANTITIES`."""
    return 1e3 if QUANTITIES[quantity][1].startswith("mm") else degrees(1.0)


def _estimates(left: dict[str, Any]) -> list[str]:
    """How large the errors of the estimates are, and whether their deviations say so."""
    over = f"over {left.pop('estimation.samples', 0)} samples"
    errors = {
        "rmse": ("RMSE", _number),
        "max": ("largest", _number),
        "efficiency": ("× bound for random leaders", _number),
    }
    deviations = {
        "coverage_3sigma": ("within 3 σ", lambda share: f"{share:.2%}"),
        "nees": ("NEES", _number),
        "nees_limits": ("expected", lambda limits: " to ".join(map(_number, limits))),
    }
    return [
        _by_quantity(left, f"Errors of the estimates {over}", errors),
        _by_quantity(left, f"Errors against their deviations {over}", deviations),
    ]


def _by_quantity(left: dict[str, Any], caption: str, columns: _Columns) -> str:
    """Figures of each quantity; a column or a row that nothing is known of is left out."""
    held = {
        name: what for name, what in columns.items() if any(p.startswith(f"estimation.{name}.") for p in left)
    }
    rows = []
    for name, (symbol, unit) in QUANTITIES.items():
        cells = []
        for column, (_, tell) in held.items():
            value = left.pop(f"estimation.{column}.{name}", None)
            scaled = scale_of(name) * value if column in ("rmse", "max") and value is not None else value
            cells.append("–" if value is None else tell(scaled))
        if set(cells) - {"–"}:
            rows.append((f"{symbol} [{unit}]", *cells))
    return table_html(caption, ("", *(label for label, _ in held.values())), rows)


def _bounds(left: dict[str, Any]) -> str:
    """Violations and tightness of every bound."""
    rows = []
    for form, pattern in _FORMS.items():
        for name, symbol in _BOUNDED.items():
            key = pattern.format(name)
            broken = left.pop(f"bounds.violations.{key}", None)
            tightness = left.pop(f"bounds.tightness.{key}", None)
            if broken is not None:
                largest = "–" if tightness is None else f"{tightness:.1%}"
                rows.append((f"{symbol}, {form}", str(broken), largest))
    caption = f"Bounds of the errors, checked in {left.pop('bounds.checked', 0)} samples"
    return table_html(caption, ("", "violated in", "largest error / bound"), rows)


def _certificate(left: dict[str, Any]) -> str:
    """What was guaranteed beforehand, or why nothing can be; what it rests on unfolds."""
    parts: dict[str, dict[str, Any]] = {}
    for path in [path for path in left if path.startswith(f"{_CERTIFICATE}.")]:
        _, part, *rest = path.split(".")
        parts.setdefault(part, {})[".".join(rest)] = left.pop(path)
    rows, assumptions = [], []
    for part, figures in parts.items():
        numbers = [f"{name} {_text(value)}".strip() for name, value in figures.items() if name not in _WORDS]
        rows.append((part.replace("_", " "), "; ".join(filter(None, [*numbers, figures.get("why")]))))
        assumptions += [(part.replace("_", " "), _text(figures["assumes"]))] if "assumes" in figures else []
    certificate = table_html("Guaranteed beforehand, in SI units", ("", "certificate"), rows, long=True)
    rests_on = table_html("", ("", "assumes"), assumptions, long=True)
    return certificate + (
        f"<details><summary>What it rests on</summary>{rests_on}</details>" if rests_on else ""
    )


def _leaves(value: object, path: str) -> Iterator[tuple[str, Any]]:
    """Every figure with its path, such as ``estimation.rmse.v1``."""
    if isinstance(value, Mapping):
        for name, inner in value.items():
            yield from _leaves(inner, f"{path}.{name}" if path else str(name))
    else:
        yield path, value


def _number(value: float) -> str:
    return f"{value:.3g}" if abs(value) < 1000.0 else f"{value:.0f}"


def _text(value: object) -> str:
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, (list, tuple)):
        return "; ".join(map(_text, value))
    return str(value)
