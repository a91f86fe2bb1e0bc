from __future__ import annotations

import numpy as np

from hil.reports.page import Section, Timeline, page
from hil.reports.plots import Panel, TimeAxis, draw_line, table


def over_time() -> Panel:
    t = np.array([0.0, 1.0])
    plot = TimeAxis(0.0, 1.0, 0.0).panel("y", (0.0, 1.0))
    draw_line(plot, table(t, t, {"y": t}), "y", "#123456")
    return Panel("Course", "How it went.", (), plot)


def test_plots_that_zoom_have_tools_once_and_a_slider_only_where_time_runs() -> None:
    sections = [Section("One", panels=[over_time(), over_time()])]
    still, moved = page("p", "", sections), page("p", "", sections, timeline=Timeline(0.0, 1.0))
    for html in (still, moved):
        assert html.count('id="zoom"') == html.count('id="whole"') == 1
    assert 'id="time"' not in still
    assert moved.count('id="time"') == 1
    assert 'id="bar"' not in page("p", "", [Section("One", "<p>words</p>")])


def test_contents_lead_to_the_sections_that_are_there() -> None:
    html = page(
        "p", "", [Section("How it went", "<p>well</p>"), Section("Empty"), Section("Two", "x", anchor="b")]
    )
    assert '<a href="#how-it-went">How it went</a>' in html
    assert '<section id="how-it-went">' in html
    assert '<a href="#b">Two</a>' in html
    assert "Empty" not in html
