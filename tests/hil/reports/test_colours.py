from __future__ import annotations

from itertools import product

import pytest

from hil.reports.colours import (
    AGENTS,
    BOUND,
    DARK,
    DARK_PAGE,
    DARKENED,
    FOLLOWER,
    GREY,
    LEADER,
    LIGHT_PAGE,
    PAPER,
    reference,
    variables,
)

LEAST_FOR_TEXT, LEAST_FOR_LINES = 4.5, 3.0


def luminance(colour: str) -> float:
    """Relative luminance by WCAG 2."""
    parts = [int(colour[start : start + 2], 16) / 255.0 for start in (1, 3, 5)]
    red, green, blue = (p / 12.92 if p <= 0.04045 else ((p + 0.055) / 1.055) ** 2.4 for p in parts)
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue


def contrast(one: str, other: str) -> float:
    high, low = sorted((luminance(one), luminance(other)), reverse=True)
    return (high + 0.05) / (low + 0.05)


@pytest.mark.parametrize("page", [LIGHT_PAGE, DARK_PAGE], ids=["light", "dark"])
def test_texts_stand_out_in_both_schemes(page: dict[str, str]) -> None:
    for text, ground in product(("ink", "soft", "good", "warn", "bad", "link"), ("ground", "raised")):
        assert contrast(page[text], page[ground]) >= LEAST_FOR_TEXT, (text, ground)
    assert contrast(page["ground"], page["link"]) >= LEAST_FOR_TEXT  # of a pressed button
    assert contrast(page["frame"], page["ground"]) >= LEAST_FOR_LINES


@pytest.mark.parametrize("dark", [False, True])
def test_what_is_drawn_stands_out_in_both_schemes(dark: bool) -> None:
    def shown(colour: str) -> str:
        return DARKENED[colour] if dark else colour

    for written in (DARK, GREY):
        assert contrast(shown(written), shown(PAPER)) >= LEAST_FOR_TEXT
    for drawn in (LEADER, FOLLOWER, BOUND, *AGENTS):
        assert contrast(shown(drawn), shown(PAPER)) >= LEAST_FOR_LINES


def test_turning_dark_and_back_gives_the_colours_that_were() -> None:
    assert len(set(DARKENED.values())) == len(DARKENED)


def test_legends_follow_the_scheme() -> None:
    assert reference(LEADER) == f"var(--c{LEADER[1:]})"
    assert f"--c{LEADER[1:]}: {DARKENED[LEADER]};" in variables(dark=True)
    assert reference("#123456") == "#123456"
