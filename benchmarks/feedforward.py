"""Where it pays to feed the leader's estimated turn rate forward, and where its noise does harm.

    python benchmarks/feedforward.py [--seeds 4] [--figure docs/feedforward.png]

The scenario ``turtlebot3`` over noise of the motion capture and its latency, by the compiled closed loop.
Printed, for the laws ``independent`` (Prop. 2), ``feedforward`` and ``faded``: RMS distance of rho from rho_0
[mm] over the evaluated time of all seeds, and the ratio of the fade to the better of the two others.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Mapping, Sequence
from itertools import product
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from formation.angles import FloatArray
from hil.errors import CheckFailedError
from hil.lockstep.flyer import Flyer
from hil.scenario.files import load_scenario
from hil.sweep.tally import judged_span, true_states

LAWS = ("independent", "feedforward", "faded")
POSITIONS_MM = (0.3, 1.0, 2.0, 5.0, 10.0, 20.0)
HEADINGS_DEG = (0.2, 1.0, 3.0)
LATENCIES_S = (0.03, 0.1, 0.3, 0.8)
PATIENT = ("controller.max_age_s=1.5", "estimator.coast_after_s=1.5", "estimator.lost_after_s=2.5")

Cell = tuple[float, float, float]
"""Latency [s], heading noise [deg], position noise [mm]."""


def distances_mm(cell: Cell, seeds: int) -> dict[str, float]:
    """RMS distance from rho_0 [mm] by law; nan where a run broke down."""
    latency, heading, position = cell
    noise = {"sigma_position": 1e-3 * position, "sigma_heading": math.radians(heading)}
    given = [f"{who}.{key}={value}" for who in ("mocap", "estimator") for key, value in noise.items()]
    given += [f"mocap.latency_s={latency}", *PATIENT]
    return {law: distance_mm([*given, f"controller.law={law}"], seeds) for law in LAWS}


def distance_mm(overrides: Sequence[str], seeds: int) -> float:
    """RMS distance from rho_0 [mm] over runs of ``turtlebot3`` with changes; nan if one broke down."""
    scenario = load_scenario("turtlebot3", overrides)
    flyer, span = Flyer(scenario, after_s=0.0), judged_span(scenario)
    squares: list[FloatArray] = []
    for seed in range(seeds):
        try:
            flown = flyer.fly(seed + 1)
        except CheckFailedError:
            return math.nan
        squares.append((true_states(flown, 0, span).rho - scenario.formation.rho_0) ** 2)
    return 1e3 * math.sqrt(float(np.mean(np.concatenate(squares))))


def draw(found: Mapping[Cell, Mapping[str, float]], path: Path) -> None:
    """Maps of feed-forward and of the fade, each against Prop. 2, over noise and latency."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.0, 4.6), layout="constrained")
    axes = figure.subplots(2, len(LATENCIES_S), sharex=True, sharey=True)
    for (row, law), (column, latency) in product(enumerate(LAWS[1:]), enumerate(LATENCIES_S)):
        cells = [[found[latency, h, p] for p in POSITIONS_MM] for h in HEADINGS_DEG]
        share = np.array([[cell[law] / cell["independent"] for cell in line] for line in cells])
        panel = axes[row, column]
        image = panel.imshow(
            np.log2(share), cmap="RdBu_r", vmin=-2.0, vmax=2.0, aspect="auto", origin="lower"
        )
        for (y, x), value in np.ndenumerate(share):
            dark = abs(math.log2(value)) > 1.2
            panel.text(x, y, f"{value:.2f}", ha="center", va="center", fontsize=8, color="w" if dark else "k")
        panel.set_xticks(range(len(POSITIONS_MM)), [f"{each:g}" for each in POSITIONS_MM])
        panel.set_yticks(range(len(HEADINGS_DEG)), [f"{each:g}" for each in HEADINGS_DEG])
        panel.set_title(f"{law}, latency {1e3 * latency:g} ms", fontsize=10)
    figure.supxlabel("position noise [mm]", fontsize=10)
    figure.supylabel("heading noise [deg]", fontsize=10)
    bar = figure.colorbar(image, ax=axes, ticks=[-2, -1, 0, 1, 2])
    bar.set_ticklabels(["1/4", "1/2", "1", "2", "4"])
    bar.set_label("RMS of rho - rho_0, against Prop. 2")
    FigureCanvasAgg(figure)
    figure.savefig(path, dpi=110, metadata={"Software": None})


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--seeds", type=int, default=4)
    parser.add_argument("--figure", type=Path)
    given = parser.parse_args()
    laws = "".join(f"{law:>13}" for law in LAWS)
    print(f"{given.seeds} seeds  latency  heading  position {laws}  fade/better")
    found: dict[Cell, dict[str, float]] = {}
    for cell in product(LATENCIES_S, HEADINGS_DEG, POSITIONS_MM):
        found[cell] = by_law = distances_mm(cell, given.seeds)
        better = by_law["faded"] / min(by_law["independent"], by_law["feedforward"])
        latency, heading, position = cell
        where = f"{1e3 * latency:10.0f} ms {heading:5.1f} deg {position:6.1f} mm"
        print(f"{where:>34} {''.join(f'{by_law[law]:13.1f}' for law in LAWS)} {better:10.2f}", flush=True)
    if given.figure is not None:
        draw(found, given.figure)


if __name__ == "__main__":
    main()
