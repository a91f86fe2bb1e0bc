"""The figures of a summary as tables, by the part of the page where they belong."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from math import degrees
from typing import Any

from hil.judge.consistency import are_telling
from hil.judge.intervals import TimeInterval
from hil.reports.certificate_table import certificate_html
from hil.reports.figure_labels import BOUNDED, LABELS
from hil.reports.notation import written
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
_PARTS = {
    "Estimates": "estimates",
    "Largest errors seen": "bounds",
    "Inputs err as little as assumed, of the samples": "bounds",
    "Certified estimates": "bounds",
    "Formation": "formation",
    "Commands": "commands",
}
_MOST_STOPS = 20
_Columns = Mapping[str, tuple[str, Callable[[Any], str]]]
_COUNTS = {
    "rejected": ("latency", "Inputs refused, by cause"),
    "certified.failed": ("bounds", "Not certified, by the assumption that failed"),
}
_ELSEWHERE = (
    *("scenario", "seed", "mode", "estimator", "law", "duration_s", "truth", "findings", "orders_refused"),
    *("spells", "window.", "log.", "law.", "parity.", "stopped_by."),
)
"""What other parts of the page say."""


def summary_tables(summary: Mapping[str, Any]) -> dict[str, str]:
    """Tables of all figures of a summary by section; what is not there is left out.

    Sections: ``estimates``, ``bounds``, ``formation``, ``commands``, ``latency``, ``certificate``, and
    ``others``, of what nobody has words for.
    """
    certificate = summary.get("certificate", {})
    known = {name: value for name, value in summary.items() if name != "certificate"}
    left = {path: value for path, value in _leaves(known, "") if not _said_elsewhere(path)}
    tables: dict[str, list[str]] = {
        "estimates": _estimates(left),
        "bounds": [_published(left), *_bounds(left)],
    }
    for caption, labels in LABELS.items():
        rows = [
            (label.words, _number(label.scale * left.pop(path)), label.unit)
            for path, label in labels.items()
            if path in left
        ]
        counted = not any(unit for *_, unit in rows)
        header = ("", "count") if counted else ("", "value", "unit")
        cells = [row[: len(header)] for row in rows]
        tables.setdefault(_PARTS.get(caption, "latency"), []).append(table_html(caption, header, cells))
    for group, (part, caption) in _COUNTS.items():
        counts = [
            (path.removeprefix(f"{group}.").replace("_", " "), _text(left.pop(path)))
            for path in list(left)
            if path.startswith(f"{group}.")
        ]
        tables.setdefault(part, []).append(table_html(caption, ("", "count"), counts))
    told = {part: _side_by_side(each) for part, each in tables.items()}
    rest = [(_in_words(path), _text(value)) for path, value in left.items()]
    return told | {
        "certificate": certificate_html(certificate),
        "others": table_html("In SI units", ("", "value"), rest, long=True),
    }


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
        "max_at_s": ("at [s]", lambda at_s: f"{at_s:.2f}"),
        "efficiency": ("× bound for random leaders", _number),
    }
    deviations = {
        "coverage_3sigma": ("within 3 σ", lambda share: f"{share:.2%}"),
        "nees": ("NEES", _number),
        "nees_limits": ("expected", _expected),
    }
    return [
        _by_quantity(left, f"Errors of the estimates {over}", errors),
        _by_quantity(left, f"Errors against their deviations {over}", deviations),
    ]


def _expected(limits: Sequence[float]) -> str:
    """Where a NEES is expected, if that says anything."""
    return " to ".join(map(_number, limits)) if are_telling(limits) else "too short to tell"


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
            rows.append((f"{symbol}\u00a0[{unit}]", *cells))
    return table_html(caption, ("", *(label for label, _ in held.values())), rows)


def _published(left: dict[str, Any]) -> str:
    """The bounds that estimates went out with."""
    path, rows = "bounds.published", []
    checked = left.pop(f"{path}.checked", None)
    for name, label in BOUNDED.items():
        median = left.pop(f"{path}.median.{name}", None)
        shares = [left.pop(f"{path}.{what}.{name}", None) for what in ("says_something", "tightness")]
        violated = left.pop(f"{path}.violations.{name}", None)
        if median is not None:
            figures = (_number(label.scale * median), _share(shares[0]), _count(violated), _share(shares[1]))
            rows.append((f"{label.words}\u00a0[{label.unit}]", *figures))
    over = "" if checked is None else f", checked in {checked} samples"
    header = ("", "median", "says something", "violated in", "largest error / bound")
    return table_html(f"Bounds as published with the estimates{over}", header, rows)


def _bounds(left: dict[str, Any]) -> Iterator[str]:
    """Violations and tightness of every bound, by the largest errors seen and by those assumed."""
    seen, assumed = [], []
    for form, pattern in _FORMS.items():
        for name, label in BOUNDED.items():
            key, what = pattern.format(name), f"{label.words}, {form}"
            broken, used = _verdict_on(left, "bounds", key)
            if broken is not None:
                seen.append((what, _count(broken), _share(used)))
            held = left.pop(f"bounds.assumed.holds.{key}", None)
            broken, used = _verdict_on(left, "bounds.assumed.where_inputs_hold", key)
            if held is not None:
                assumed.append((what, _share(held), _count(broken), _share(used)))
    checked = left.pop("bounds.checked", 0)
    yield table_html(
        f"Bounds by the largest errors seen, checked in {checked} samples",
        ("", "violated in", "largest error / bound"),
        seen,
    )
    where = left.pop("bounds.assumed.where_inputs_hold.samples", 0)
    yield table_html(
        f"Bounds by the errors assumed; the last two in the {where} samples whose inputs kept to them",
        ("", "held in", "violated in", "largest error / bound"),
        assumed,
    )


def _verdict_on(left: dict[str, Any], path: str, key: str) -> tuple[int | None, float | None]:
    return left.pop(f"{path}.violations.{key}", None), left.pop(f"{path}.tightness.{key}", None)


def _side_by_side(tables: Sequence[str]) -> str:
    filled = "\n".join(filter(None, tables))
    return f'<div class="tables">\n{filled}\n</div>' if filled else ""


def _said_elsewhere(path: str) -> bool:
    return any(path == name or (name.endswith(".") and path.startswith(name)) for name in _ELSEWHERE)


def _in_words(path: str) -> str:
    """The path of a figure that nobody has words for."""
    return written(path.replace(".", ", ")).replace("_", " ")


def _leaves(value: object, path: str) -> Iterator[tuple[str, Any]]:
    """Every figure with its path, such as ``estimation.rmse.v1``."""
    if isinstance(value, Mapping):
        for name, inner in value.items():
            yield from _leaves(inner, f"{path}.{name}" if path else str(name))
    else:
        yield path, value


def _count(count: int | None) -> str:
    return "–" if count is None else str(count)


def _share(share: float | None) -> str:
    return "–" if share is None else f"{share:.1%}"


def _number(value: float) -> str:
    value += 0.0  # minus zero is zero
    return f"{value:.3g}" if abs(value) < 1000.0 else f"{value:.0f}"


def _text(value: object) -> str:
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, (list, tuple)):
        return "; ".join(map(_text, value))
    return str(value)
