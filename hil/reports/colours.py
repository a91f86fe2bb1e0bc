"""Colours of the pages, each with the one that takes its place where the page is dark.

Those of texts have at least 4.5 : 1 against their ground in both schemes, as WCAG 2 asks for at level AA.
"""

from __future__ import annotations

# Colours of Okabe and Ito, told apart by eyes of every kind; bounds and limits differ by their dashes, too.
BLUE, VERMILION, PURPLE, DARK, GREY = "#0072b2", "#d55e00", "#a8478a", "#333333", "#6e6e6e"
BLACK, PAPER, GRID, AXIS = "#222222", "#ffffff", "#e4e4e4", "#bbbbbb"
SHADE = "#000000"
GREEN, OCHRE = "#00795a", "#8a6d00"
AGENTS = (BLUE, VERMILION, PURPLE, GREEN, OCHRE, DARK)
"""Colours of the robots of a chain, in turn."""
LEADER, FOLLOWER, BELIEVED, BOUND, ORBIT, TRUE, LIMIT = BLUE, VERMILION, BLUE, VERMILION, PURPLE, DARK, GREY

DARKENED = {
    BLUE: "#5bb8f0",
    VERMILION: "#ff8f45",
    PURPLE: "#e08fc8",
    DARK: "#d6d6d6",
    GREY: "#a2a2a2",
    BLACK: "#f4f4f4",
    PAPER: "#15181c",
    GRID: "#30353b",
    AXIS: "#5f666e",
    SHADE: "#fefefe",
    GREEN: "#48c79a",
    OCHRE: "#d9b441",
}
"""Colours of plots and legends, and what they are in the dark. No two become one."""

LIGHT_PAGE = {
    "ground": PAPER,
    "raised": "#f4f5f6",
    "ink": "#1c1c1c",
    "soft": "#595959",
    "line": "#d9d9d9",
    "frame": "#8c8c8c",
    "good": "#00694a",
    "warn": "#7a5200",
    "bad": "#a63c00",
    "link": "#0059b3",
}
DARK_PAGE = {
    "ground": DARKENED[PAPER],
    "raised": "#20242a",
    "ink": "#e9eaeb",
    "soft": "#a9afb6",
    "line": "#383e45",
    "frame": "#7d858e",
    "good": "#4fc79d",
    "warn": "#e3b34d",
    "bad": "#ff9a66",
    "link": "#7db7ff",
}
"""What the page around the plots is drawn in, by its names in the style."""


def reference(colour: str) -> str:
    """A colour as legends name it, so that it follows the scheme; any other one as it is."""
    return f"var(--c{colour[1:]})" if colour in DARKENED else colour


def variables(dark: bool) -> str:
    """Declarations of all colours for one scheme."""
    page = DARK_PAGE if dark else LIGHT_PAGE
    plots = {f"c{light[1:]}": shown if dark else light for light, shown in DARKENED.items()}
    return " ".join(f"--{name}: {colour};" for name, colour in (page | plots).items())
