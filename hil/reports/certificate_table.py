"""What was guaranteed beforehand, in words, and what it rests on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from hil.reports.figure_labels import CLAIMS, FIGURES
from hil.reports.notation import written
from hil.reports.page import table_html

_WORDS = ("why", "assumes")
_NOTHING = "nothing is guaranteed"


def certificate_html(certificate: Mapping[str, Mapping[str, Any]]) -> str:
    """The claims of a certificate, or why nothing can be; what they rest on unfolds. Empty without any."""
    rows = [(_name(claim), _guaranteed(held)) for claim, held in certificate.items()]
    rests_on: dict[str, list[str]] = {}
    for claim, held in certificate.items():
        for assumed in held.get("assumes", []):
            rests_on.setdefault(written(str(assumed)), []).append(_name(claim))
    claims = table_html("Guaranteed before anything drove", ("", "guarantee"), rows, long=True)
    used = [(assumed, _used_by(names, len(certificate))) for assumed, names in rests_on.items()]
    assumptions = table_html("", ("it assumes", "for"), used, long=True)
    folded = f"<details><summary>What it rests on</summary>{assumptions}</details>" if used else ""
    return claims + folded


def _name(claim: str) -> str:
    return CLAIMS.get(claim, written(claim.replace("_", " ")))


def _guaranteed(held: Mapping[str, Any]) -> str:
    """Such as ``ρ from 0.157 m to 0.267 m``; and why there is no more."""
    told: list[str] = []
    order = [*filter(held.__contains__, FIGURES), *(name for name in held if name not in FIGURES)]
    for name in order:
        if name not in _WORDS:
            label, value = FIGURES.get(name), held[name]
            figure = (
                f"{label.words} {label.scale * float(value):.4g} {label.unit}"
                if label is not None
                else f"{written(name)} {value}"
            )
            joined = bool(told) and label is not None and label.words == "to"
            told.append(f" {figure}" if joined else f", {figure}" if told else figure)
    why = f"{_NOTHING}: " if not told else "; "
    return "".join(told) + (why + written(str(held["why"])) if held.get("why") else "")


def _used_by(names: Sequence[str], of: int) -> str:
    return "everything" if len(names) == of > 1 else "; ".join(names)
