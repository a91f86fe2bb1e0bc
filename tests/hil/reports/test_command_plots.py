from __future__ import annotations

from dataclasses import replace

from hil.figures.plot_data import PlotData
from hil.judge.run_data import RunData
from hil.reports.command_plots import stops_of


def test_waiting_before_the_first_drive_is_no_standstill(exact_run_data: RunData) -> None:
    commands = [
        replace(each, stop="no estimate" if number < 40 else "stale" if 60 <= number < 65 else "")
        for number, each in enumerate(exact_run_data.commands)
    ]
    stops = stops_of(PlotData.of(replace(exact_run_data, commands=commands)))
    assert [(stop.what, stop.count) for stop in stops] == [("stale", 5)]
