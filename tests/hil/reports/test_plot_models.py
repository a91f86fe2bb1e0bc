"""Bokeh's own Python classes, which know every property and its type, read what we write of their models."""

from __future__ import annotations

import json
import logging
import math
import re
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from bokeh.core.property.vectorization import Field as BokehField
from bokeh.document import Document
from bokeh.plotting import figure

from hil.judge.run_data import RunData
from hil.reports.plot_models import Field, Figure, Model, Value, document_of, source_of
from hil.reports.sweep_report import sweep_report
from tests.hil.reports.test_run_report import report
from tests.hil.reports.test_sweep_report import cell

NAN = math.nan

Read = Callable[[str], list[Any]]


@pytest.fixture
def read(caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch) -> Iterator[Read]:
    """Roots of a document as Bokeh reads them; it raises for wrong values, and tells of unknown names."""

    def roots(document: str) -> list[Any]:
        found = Document.from_json(json.loads(document)).roots
        assert caplog.messages == []
        return found

    # Whatever others have made of its logger in this process.
    teller = logging.getLogger("bokeh.core.has_props")
    monkeypatch.setattr(teller, "disabled", False)
    teller.addHandler(caplog.handler)
    with caplog.at_level(logging.WARNING, teller.name):
        yield roots
    teller.removeHandler(caplog.handler)


def document_in(page: str) -> str:
    found = re.search(r'<script type="application/json" id="plots">{"plots":(.*?)}</script>', page, re.DOTALL)
    assert found is not None
    return found[1]


def test_bokeh_reads_the_plots_of_a_run(read: Read, exact_run_data: RunData) -> None:
    page = report(exact_run_data)
    plots = read(document_in(page))
    assert all(isinstance(plot, figure) for plot in plots)
    assert len(plots) == len(re.findall("<h3>", page))
    assert {"y [m]", "ρ [m]", "v₁ [m/s]", "NIS", "age [ms]"} <= {plot.left[0].axis_label for plot in plots}


def test_bokeh_reads_the_plots_of_a_sweep(read: Read) -> None:
    cells = [cell(estimator, 0.001, 0.002, 0.0, 0.0) for estimator in ("ekf", "ukf")]
    page = sweep_report({"cells": cells, "run_seconds": 60.0, "wall_s": 1.0})
    assert len(read(document_in(page))) == len(re.findall("<h3>", page))


@pytest.mark.parametrize("wrong", [{"widht": 1.0}, {"line_width": "fat"}])
def test_bokeh_would_tell_of_what_it_does_not_know(read: Read, wrong: dict[str, object]) -> None:
    document, _ = document_of([Model("Span", **wrong)])
    with pytest.raises((AssertionError, ValueError)):
        read(json.dumps(document))


def test_values_arrive_as_they_were_given(read: Read) -> None:
    time = Model("Range1d", start=0.0, end=2.0)
    plots = [
        Figure(height=200, x_range=time, y_range=Model("Range1d"), x_label="t", y_label=label)
        for label in ("one", "two")
    ]
    table = {
        "t": np.array([0.0, 1.0, 2.0]),
        "y": np.array([1.5, NAN, math.inf], dtype=np.float32),
        "texts": ["<a>", "ö", ""],
        "numbers": [1, NAN, -math.inf],
    }
    renderer = plots[1].add_glyph(source_of(table), Model("Text", x=Field("t"), y=Value(0.5)))
    plots[1].add_tools(Model("HoverTool", renderers=[renderer]))
    document, numbers = document_of(plots)
    one, two = read(json.dumps(document, allow_nan=False))
    assert [one.id, two.id] == numbers
    assert one.x_range is two.x_range
    assert two.x_range.end == 2.0
    drawn = two.renderers[0]
    assert two.tools[0].renderers == [drawn]
    assert drawn.glyph.x == BokehField("t")
    assert drawn.glyph.y.value == 0.5
    data = drawn.data_source.data
    assert data["t"].tolist() == [0.0, 1.0, 2.0]
    assert data["y"].dtype == np.float32
    np.testing.assert_array_equal(data["y"], table["y"])
    assert data["texts"] == table["texts"]
    np.testing.assert_array_equal(data["numbers"], table["numbers"])
