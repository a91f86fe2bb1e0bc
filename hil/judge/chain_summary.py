"""The verdict on a chain: that of each pair, and what only the chain as a whole has."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from hil.judge.chain_pairs import DRIVEN, driven_trajectory, pair_figures, settling_times
from hil.judge.run_data import RunData
from hil.judge.summary import summarise
from hil.log.report_json import known
from hil.scenario.parts import station
from hil.scenario.schema import Scenario

_OF_THE_CHAIN = ("seed", "mode", "estimator", "law", "duration_s", "clock", "log")
_ONLY_ONCE = ("scenario", *_OF_THE_CHAIN)


def summarise_chain(scenario: Scenario, runs: Sequence[RunData]) -> dict[str, Any]:
    """JSON of ``run`` and ``replay`` for a chain, from the run data of its pairs, the leader's first.

    ``pairs``, one for each follower: ``leader``, ``follower``, the parts of
    :func:`hil.judge.summary.summarise` that are the pair's own and, where the truth is known, those of
    :func:`hil.judge.chain_pairs.pair_figures`, so that they stand beside ``abreast simulate``; settled is
    who keeps to :data:`hil.judge.chain_pairs.DRIVEN`. ``recovered``: whether all pairs have settled.
    """
    summaries = [summarise(run_data) for run_data in runs]
    trajectory = driven_trajectory(runs)
    figures: list[dict[str, float | None]] = [{} for _ in runs]
    recovered: bool | None = None
    if trajectory is not None:
        settled = settling_times(trajectory, scenario.formation.rho_0, station(scenario), DRIVEN)
        recovered = all(moment is not None for moment in settled)
        figures = [
            pair_figures(trajectory, k, moment, scenario.controller.v_max) for k, moment in enumerate(settled)
        ]
    pairs = [
        {
            "leader": run_data.scenario.leader.name,
            "follower": run_data.scenario.follower.name,
            **figure,
            **{name: part for name, part in summary.items() if name not in _ONLY_ONCE},
        }
        for run_data, summary, figure in zip(runs, summaries, figures, strict=True)
    ]
    whole = {name: summaries[0][name] for name in _OF_THE_CHAIN if name in summaries[0]}
    result: dict[str, Any] = known(
        {
            "scenario": scenario.name,
            **whole,
            "agents": len(pairs) + 1,
            "recovered": recovered,
            "pairs": pairs,
        }
    )
    return result
