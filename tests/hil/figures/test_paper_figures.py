from __future__ import annotations

import re
from pathlib import Path
from xml.etree import ElementTree

import pytest

from hil.figures.paper_figures import KINDS, Kind, PaperFigure, write_paper_figures
from hil.figures.plot_data import PlotData
from hil.figures.run_figures import run_paper_figures
from hil.judge.run_data import RunData
from hil.scenario.files import load_scenario
from hil.simulate.experiments import experiment

PANELS = {"tracks", "distance", "alpha1", "alpha2", "v1", "alpha1_error", "u1", "v2", "u2", "latency"}
POINTS = 72.0


@pytest.mark.parametrize("kind", KINDS)
def test_a_run_leaves_a_file_for_every_panel_and_the_same_bytes_again(
    exact_run_data: RunData, tmp_path: Path, kind: Kind
) -> None:
    figures = run_paper_figures(PlotData.of(exact_run_data))
    for folder in ("once", "again"):
        write_paper_figures(figures, tmp_path / folder, kind)
    once = {path.name: path.read_bytes() for path in (tmp_path / "once").iterdir()}
    assert set(once) == {f"{name}.{kind}" for name in PANELS}
    assert once == {path.name: path.read_bytes() for path in (tmp_path / "again").iterdir()}


def test_pdfs_are_as_wide_as_a_column_and_bring_their_fonts(tmp_path: Path) -> None:
    drawn = PaperFigure("one", lambda axes: axes.plot([0, 1], label=r"$\alpha_1$"))
    write_paper_figures([drawn], tmp_path, "pdf")
    held = (tmp_path / "one.pdf").read_bytes()
    box = re.search(rb"/MediaBox \[([^\]]*)\]", held)
    assert box is not None
    assert float(box[1].split()[2]) == pytest.approx(3.4 * POINTS)
    assert b"/FontFile2" in held  # what it is drawn with is embedded as TrueType
    assert b"/Type3" not in held


def test_svgs_need_no_font(tmp_path: Path) -> None:
    write_paper_figures([PaperFigure("one", lambda axes: axes.set_xlabel("time"))], tmp_path, "svg")
    root = ElementTree.parse(tmp_path / "one.svg").getroot()
    assert root.get("width") == "244.8pt"
    assert not list(root.iter("{http://www.w3.org/2000/svg}text"))


@pytest.mark.parametrize(
    ("scenario", "names"),
    [
        ("turtlebot3", {"tracks", "shape", "distance", "bearings", "v2", "u2"}),
        ("chain5-turtlebot3", {"tracks", "rho", "v", "u", "curvature"}),
    ],
)
def test_an_experiment_leaves_its_figures_below_its_folder(
    tmp_path: Path, scenario: str, names: set[str]
) -> None:
    short = load_scenario(scenario, ["run.duration_s=2.0", "run.evaluate_from_s=1.0"])
    experiment(short, tmp_path, figures="svg")
    assert {path.stem for path in (tmp_path / "figures").iterdir()} == names
