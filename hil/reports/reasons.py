"""The verdict on a run in one sentence, and its reasons, each with where in the page it is looked at."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from typing import Any

from hil.judge.certified import certified_violations
from hil.judge.spell_words import longest_first, times_of
from hil.judge.summary_text import extended_violations, judged_by, parity_line, warnings_by_part
from hil.reports.notation import written

GOOD, WARN, BAD, PLAIN = "good", "warn", "bad", "soft"
_SIGNS = {GOOD: ("✓", "good: "), WARN: ("!", "look again: "), BAD: ("✗", "bad: "), PLAIN: ("·", "")}
_FAR = 0.5
"""Who is further off his station than this share of the least distance is not in formation, noise or not."""
_SHORT = 60
"""A warning of so many letters is told in full."""
PLACES = {
    "spells": "bad-spells",
    "bounds": "bounds",
    "formation": "formation",
    "saturation": "commands",
    "tracking": "estimates",
    "latency": "latency",
    "findings": "findings",
    "replay": "how-it-was-made",
}
"""Sections of the page by what is judged."""
_NAMES = {"spells": "bad spells"}


@dataclass(frozen=True, slots=True)
class Reason:
    """What was judged, how it went (``GOOD``, ``WARN``, ``BAD``, ``PLAIN``), and in a few words, how."""

    part: str
    style: str
    text: str


def reasons_of(summary: Mapping[str, Any]) -> list[Reason]:
    """What speaks for a run and against it; a part of which nothing is known is left out."""
    warned = warnings_by_part(summary)
    told = {
        "spells": _spells(summary),
        "bounds": _bounds(summary),
        "formation": _formation(summary),
        "saturation": _saturation(summary),
        "tracking": _tracking(summary),
        "latency": _latency(summary),
        "findings": _findings(summary),
        "replay": _replay(summary),
    }
    reasons = []
    for part, reason in told.items():
        if reason is None and not warned.get(part):
            continue
        reasons.append(_doubted(part, reason, warned.get(part, ())))
    return reasons


def _doubted(part: str, reason: Reason | None, warnings: Sequence[str]) -> Reason:
    """A reason with what makes one look again, where its own text does not say so."""
    brief = "; ".join(map(_brief, warnings))
    if reason is None:
        return Reason(part, WARN, brief)
    if not warnings or reason.style == BAD:
        return reason
    says = reason.style == WARN
    return Reason(part, WARN, reason.text if says else f"{reason.text}; {brief}")


def verdict_html(summary: Mapping[str, Any]) -> str:
    """The sentence, what the run is judged by where that is not the truth, and the reasons below."""
    reasons = reasons_of(summary)
    style, sentence = _verdict(reasons)
    rows = "".join(
        f'<li><span class="{reason.style}" aria-hidden="true">{_SIGNS[reason.style][0]}</span>'
        f'<a href="#{PLACES[reason.part]}"><span class="hidden">{_SIGNS[reason.style][1]}</span>'
        f"{_NAMES.get(reason.part, reason.part)}</a><span>{escape(written(reason.text))}</span></li>"
        for reason in reasons
    )
    return (
        f'<div class="verdict {style}"><p><strong>{escape(sentence)}</strong></p>'
        f"{judged_html(summary)}</div>\n"
        f'<ul class="reasons">{rows}</ul>\n'
    )


def judged_html(*summaries: Mapping[str, Any]) -> str:
    """What runs are judged by where that is not the truth, for under their verdict."""
    judged = dict.fromkeys(filter(None, map(judged_by, summaries)))
    return "".join(f'<p class="soft">Judged {escape(each)}.</p>' for each in judged)


def warnings_html(summary: Mapping[str, Any], part: str) -> str:
    """What deserves a second look in one part, in full."""
    lines = "".join(
        f'<li><span class="warn">!</span> {escape(written(each))}</li>'
        for each in warnings_by_part(summary).get(part, [])
    )
    return f'<ul class="warnings">{lines}</ul>' if lines else ""


def finding_name(finding: Mapping[str, Any]) -> str:
    """The name of a finding in words."""
    name = str(finding["name"])
    return "NEES" if name == "nees" else name.replace("_", " ")


def _verdict(reasons: Sequence[Reason]) -> tuple[str, str]:
    wrong = [reason for reason in reasons if reason.style == BAD]
    if wrong:
        told = "; ".join(f"{reason.part}: {written(reason.text)}" for reason in wrong)
        return BAD, f"{told[0].upper()}{told[1:]}."
    doubtful = [reason.part for reason in reasons if reason.style == WARN and reason.part != "spells"]
    spells = next((reason.text for reason in reasons if reason.part == "spells"), "")
    kept = any(reason.part == "bounds" and reason.style == GOOD for reason in reasons)
    held = "All bounds held" if kept else ""
    if spells:
        also = f" {_listed(doubtful)} {_deserve(doubtful)} a second look too." if doubtful else ""
        begun = "All bounds held, but there" if kept else "There"
        return WARN, f"{begun} was a bad spell: {spells}.{also[:2].upper()}{also[2:]}"
    if doubtful:
        deserve = f"{_listed(doubtful)} {_deserve(doubtful)} a second look."
        if held:
            return WARN, f"{held}, but {deserve}"
        return WARN, f"{deserve[0].upper()}{deserve[1:]}"
    return GOOD, f"{held}, and nothing speaks against the run." if held else "Nothing speaks against the run."


def _listed(names: Sequence[str]) -> str:
    return " and ".join(filter(None, [", ".join(names[:-1]), names[-1]]))


def _deserve(names: Sequence[str]) -> str:
    return "deserve" if len(names) > 1 else "deserves"


def _spells(summary: Mapping[str, Any]) -> Reason | None:
    """The longest of the bad spells, with how it began, and how many more there were."""
    spells = longest_first(summary.get("spells", []))
    if not spells:
        return None
    more = f", and {len(spells) - 1} more" if len(spells) > 1 else ""
    return Reason("spells", WARN, f"{times_of(spells[0])}, {spells[0]['causes'][0]}{more}")


def _bounds(summary: Mapping[str, Any]) -> Reason | None:
    bounds = summary["bounds"]
    published = bounds.get("published", {})
    checked = published.get("checked") or bounds.get("checked", 0)
    counts = {
        "published": sum(published.get("violations", {}).values()),
        "extended": sum(extended_violations(summary).values()),
        "certified": sum(certified_violations(summary).values()),
    }
    if broken := {name: count for name, count in counts.items() if count}:
        told = ", ".join(f"{name} ones violated {_times(count)}" for name, count in broken.items())
        return Reason("bounds", BAD, f"{told} in {checked} samples")
    if "violations" not in published and "violations" not in bounds:
        return None
    used = published.get("tightness", {})
    share = f"; errors up to {max(used.values()):.0%} of them" if used else ""
    return Reason("bounds", GOOD, f"held in all {checked} samples{share}")


def _formation(summary: Mapping[str, Any]) -> Reason | None:
    formation = summary.get("formation", {})
    if "rho_min" not in formation:
        return None
    text = f"rho {formation['rho_min']:.3f} to {formation['rho_max']:.3f} m"
    station = formation.get("equilibrium_deviation_rms", {}).get("rho", 0.0)
    if station > _FAR * formation["rho_min"]:
        return Reason("formation", WARN, f"{text}, {station:.2g} m RMS off its station")
    if "orbit_deviation_rms" in formation:
        off = f"{1e3 * formation['orbit_deviation_rms']['rho']:.1f} mm"
        return Reason("formation", GOOD, f"{text}, {off} RMS off the noise-free run")
    return Reason("formation", PLAIN, text)


def _saturation(summary: Mapping[str, Any]) -> Reason | None:
    commands = summary.get("commands", {})
    if not commands.get("sent"):
        return None
    text = f"{commands['saturated'] / commands['sent']:.0%} of {commands['sent']} commands at a limit"
    stopped = commands["stopped"]
    text += f", {stopped} to stand still" if stopped else ""
    return Reason("saturation", GOOD, text)


def _tracking(summary: Mapping[str, Any]) -> Reason | None:
    estimation = summary["estimation"]
    samples, untracked = estimation["samples"], estimation.get("untracked", 0)
    if not samples:
        return Reason("tracking", BAD, "no estimate was marked as tracking")
    rmse = estimation.get("rmse", {})
    parts = [f"{samples} of {samples + untracked} estimates" if untracked else f"all {samples} estimates"]
    if "v1" in rmse:
        parts.append(f"RMSE v1 {1e3 * rmse['v1']:.1f} mm/s")
    if "alpha1" in rmse:
        parts.append(f"alpha1 {rmse['alpha1']:.3g} rad")
    return Reason("tracking", GOOD, ", ".join(parts))


def _latency(summary: Mapping[str, Any]) -> Reason | None:
    waits = summary.get("latency_ms", {}).get("capture_to_command")
    frames = summary.get("frames", {})
    parts = []
    if waits:
        largest = "largest of those that came" if frames.get("lost") else "largest"
        parts.append(
            f"{waits['p50']:.1f} ms (median), {waits['p99']:.1f} (99 %), {waits['max']:.1f} ({largest})"
        )
    if frames.get("lost"):
        parts.append(f"{frames['lost']} of {frames['published']} frames lost")
    return Reason("latency", GOOD, ", ".join(parts)) if parts else None


def _findings(summary: Mapping[str, Any]) -> Reason | None:
    if "findings" not in summary:
        return None
    names = [finding_name(finding) for finding in summary["findings"]]
    return Reason("findings", WARN if names else GOOD, ", ".join(names) or "none")


def _replay(summary: Mapping[str, Any]) -> Reason | None:
    found: Iterator[tuple[str, str, str]] = parity_line(summary)
    for _, text, style in found:
        return Reason("replay", GOOD if style == "green" else BAD, text)
    return None


def _brief(warning: str) -> str:
    """A warning without what it adds in brackets or after a colon, if it is long."""
    return warning if len(warning) <= _SHORT else re.split(r" \(|[:;] ", warning, maxsplit=1)[0]


def _times(count: int) -> str:
    return "once" if count == 1 else f"{count} times"
