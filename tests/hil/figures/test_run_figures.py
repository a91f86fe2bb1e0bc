from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

from hil.figures.panel_strokes import LIMIT
from hil.figures.plot_data import PlotData
from hil.figures.run_figures import draw_run
from hil.figures.run_panels import draw_alpha1_error, draw_v1, draw_v2, panels_for
from hil.judge.run_data import RunData, run_data_of_log
from hil.judge.summary import summarise
from hil.log.reader import Log

NAN = math.nan
LARGEST_BYTES = 200_000


@pytest.fixture
def axes() -> Axes:
    figure = Figure()
    FigureCanvasAgg(figure)
    return figure.add_subplot()


def drawn(run_data: RunData, path: Path) -> Image.Image:
    draw_run(PlotData.of(run_data), summarise(run_data), path)
    assert path.stat().st_size < LARGEST_BYTES
    with Image.open(path) as image:
        return image.convert("RGB")


def ink(image: Image.Image) -> float:
    """Share of the picture that is not white."""
    return float(np.mean(np.any(np.asarray(image) < 250, axis=2)))


@pytest.mark.slow
def test_a_run_is_drawn_small_and_the_same_every_time(short_log: Log, tmp_path: Path) -> None:
    run_data = run_data_of_log(short_log)
    first, again = drawn(run_data, tmp_path / "a.png"), drawn(run_data, tmp_path / "b.png")
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()
    assert first.size == again.size
    assert first.getpixel((0, 0)) == (255, 255, 255)
    assert ink(first) > 0.05


def lacks_speeds(run_data: RunData) -> RunData:
    poses = [replace(each, v1=NAN, u1=NAN, v2=NAN, u2=NAN) for each in run_data.truth]
    return replace(run_data, truth=poses, commands=[], motion_since_ns=None, frames=None)


def lacks_truth(run_data: RunData) -> RunData:
    return replace(run_data, truth=[], commands=[], motion_since_ns=None, frames=None)


def lacks_estimates(run_data: RunData) -> RunData:
    return replace(run_data, estimates=[])


def lacks_all(run_data: RunData) -> RunData:
    return replace(lacks_truth(run_data), estimates=[])


def test_all_that_is_known_has_its_panel(exact_run_data: RunData) -> None:
    assert tuple(map(len, panels_for(PlotData.of(exact_run_data)))) == (1, 4, 4)


@pytest.mark.parametrize(
    ("lack", "panels"),
    [
        (lacks_speeds, (0, 3, 3)),
        (lacks_truth, (0, 3, 2)),
        (lacks_estimates, (1, 3, 2)),
        (lacks_all, (0, 0, 0)),
    ],
)
def test_what_is_not_known_is_left_out(
    exact_run_data: RunData, tmp_path: Path, lack: object, panels: tuple[int, int, int]
) -> None:
    assert callable(lack)
    run_data = lack(exact_run_data)
    assert tuple(map(len, panels_for(PlotData.of(run_data)))) == panels
    assert ink(drawn(run_data, tmp_path / "run.png")) > 0.0


def marks(axes: Axes) -> list[int]:
    """Number of points of every set of crosses in the colour of a limit."""
    lines = [line for line in axes.lines if line.get_marker() == "x" and line.get_color() == LIMIT]
    return [len(np.asarray(line.get_xdata())) for line in lines]


def test_violations_are_marked(axes: Axes, exact_run_data: RunData) -> None:
    estimates = [
        replace(each, bound_v1=0.009, bound_alpha1=0.09, bound_h=math.inf)
        for each in exact_run_data.estimates
    ]
    for number in (100, 150, 151):
        estimates[number] = replace(
            estimates[number], v1=estimates[number].v1 + 0.01, alpha1=estimates[number].alpha1 + 0.1
        )
    run_data = replace(exact_run_data, estimates=estimates)
    draw_v1(axes, PlotData.of(run_data))
    assert "published bound" in [str(line.get_label()) for line in axes.lines]
    assert marks(axes) == [3]
    assert "violated (3)" in [str(line.get_label()) for line in axes.lines]
    draw_alpha1_error(axes, PlotData.of(run_data))
    assert marks(axes) == [3, 3]


def test_no_violation_leaves_no_mark(axes: Axes, exact_run_data: RunData) -> None:
    draw_v1(axes, PlotData.of(exact_run_data))
    draw_alpha1_error(axes, PlotData.of(exact_run_data))
    assert marks(axes) == []


def test_no_line_is_drawn_across_a_gap(axes: Axes, exact_run_data: RunData) -> None:
    silent = [each for k, each in enumerate(exact_run_data.estimates) if not 100 <= k < 160]
    draw_v1(axes, PlotData.of(replace(exact_run_data, estimates=silent)))
    line = next(line for line in axes.lines if line.get_label() == "estimate")
    assert np.count_nonzero(np.isnan(np.asarray(line.get_ydata(), dtype=float))) == 1
    (band,) = axes.collections
    assert len(band.get_paths()) == 2


def test_limits_of_a_command_show_where_they_matter(axes: Axes, exact_run_data: RunData) -> None:
    draw_v2(axes, PlotData.of(exact_run_data))
    heights = [np.asarray(line.get_ydata(), dtype=float).tolist() for line in axes.lines]
    assert [0.22, 0.22] in heights
    assert [-0.22, -0.22] not in heights
