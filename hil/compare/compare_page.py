"""The page of a comparison: verdict, metrics side by side, what differs, and the courses over each other."""

from __future__ import annotations

from html import escape

from hil.compare.compare_plots import course_panels, span_of, spread_panels
from hil.compare.comparison import Comparison, shortened
from hil.compare.comparison_text import is_same, metric_row
from hil.compare.courses import Course, course_of
from hil.compare.differences import are_of_the_law
from hil.compare.group import RUNS
from hil.compare.metrics import is_told
from hil.compare.ratio_maps import labels_of_maps, map_labels, ratio_maps
from hil.reports.heat_maps import SWITCH, choices_html
from hil.reports.page import Section, Timeline, page, table_html
from hil.reports.scroll_frame import FRAME_STYLE, framed


def compare_page(comparison: Comparison) -> str:
    """HTML of a page that needs nothing but itself. Reads the logs of the runs that it draws."""
    told = [name for name in comparison.metrics() if is_told(name)]
    rest = [name for name in comparison.metrics() if not is_told(name)]
    table = _metrics(comparison, told, "Medians, with quartiles where there are several")
    if rest:
        further = _metrics(comparison, rest, "By their names in summary.json or results.json")
        table += f"<details><summary>{len(rest)} further metrics</summary>{further}</details>"
    sections = [Section("Metrics side by side", table), Section("What differs", _differences(comparison))]
    courses: list[Course] = []
    script = "" if comparison.groups[0].kind == RUNS else SWITCH
    if comparison.groups[0].kind == RUNS:
        courses = [course for group in comparison.groups if (course := course_of(group)) is not None]
        of_each = "Of several runs the one with the median error. Plots over time zoom together."
        sections += [
            Section("Every run", panels=spread_panels(comparison), narrow=True),
            Section(
                "Courses over each other",
                f'<p class="soft">{of_each}</p>' if courses else "",
                course_panels(courses) if courses else (),
            ),
        ]
    else:
        first, *others = comparison.groups
        cells = first.tree["cells"]
        shown = map_labels(cells, laws_differ=are_of_the_law(comparison.differences))
        panels = [panel for group in others for panel in ratio_maps(first, group, list(shown))]
        choices = choices_html(cells, shown)
        words = f"<p>{choices}</p>\n{labels_of_maps(first)}"
        sections.insert(0, Section("Errors over noise", words, panels, narrow=True))
    labels = " · ".join(group.label for group in comparison.groups)
    timeline = Timeline(*span_of(courses)) if courses else None
    return page(f"{labels} – abreast", _head(comparison, labels), sections, script, timeline)


def _head(comparison: Comparison, labels: str) -> str:
    failures = "".join(f"<li>{escape(each.text)}</li>" for each in comparison.failures)
    notes = "".join(f"<li>{escape(note)}</li>" for note in comparison.notes)
    colour = "verdict bad" if failures else "verdict"
    listed = "".join(
        f"<dt>{escape(group.label)}</dt><dd>{escape(group.noun())}, {escape(str(group.path))}</dd>"
        for group in comparison.groups
    )
    return (
        f"{FRAME_STYLE}<h1>{escape(labels)}</h1>\n"
        f'<div class="{colour}"><p><strong>{escape(comparison.verdict.text)}</strong></p>'
        f"<ul>{failures}{notes}</ul></div>\n<dl>{listed}</dl>\n"
    )


def _metrics(comparison: Comparison, names: list[str], caption: str) -> str:
    labels = [group.label for group in comparison.groups]
    header = ["", labels[0], *(text for label in labels[1:] for text in (label, f"against {labels[0]}"))]
    changed = [name for name in names if not is_same(comparison, name)]
    table = framed(table_html(caption, header, [metric_row(comparison, name) for name in changed]))
    same = [name for name in names if is_same(comparison, name)]
    if same:
        table += f'<p class="soft">The same in all: {escape(", ".join(same))}.</p>'
    return table


def _differences(comparison: Comparison) -> str:
    rows = [(key, *map(shortened, values)) for key, values in comparison.differences.items()]
    if not rows:
        return "<p>Nothing in scenario, version, law and seed.</p>"
    header = ("", *(group.label for group in comparison.groups))
    return framed(table_html("Keys of the scenario, and what made the runs", header, rows, long=True))
