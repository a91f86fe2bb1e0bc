"""A log in a folder for Foxglove, Lichtblick, RViz and PlotJuggler: one file, and layouts for its topics."""

from __future__ import annotations

from collections.abc import Iterator
from heapq import merge
from pathlib import Path

from hil.exports.foxglove_file import FILE, RECORDED, FoxgloveExport, Made, write_foxglove
from hil.exports.layouts import LAYOUTS, write_layouts
from hil.exports.sources import of_what_is_whole, recorded_links
from hil.judge.replayed import ReplayChoice, Replayed, replayed
from hil.log.metadata import scenario_of
from hil.log.reader import Log
from hil.nodes.node import Outgoing, outgoing
from hil.replay.foreign_log import foreign_inputs
from hil.replay.topic_map import load_topic_map
from hil.scenario.links import links_of
from hil.scenario.schema import Scenario
from hil.wire.messages import to_ns
from hil.wire.topics import link_topics, types_of

WRITTEN = (FILE, *LAYOUTS)
"""All that an export writes into its folder."""


def export_foxglove(log: Log, folder: Path, choice: ReplayChoice) -> FoxgloveExport:
    """Write a log with its scene, and the layouts; of a damaged log what is whole.

    Estimates are those of the log, or made anew as :func:`hil.exports.table_export.export_tables` has it.
    """
    return of_what_is_whole(log, lambda whole: _export(whole, folder, choice))


def _export(log: Log, folder: Path, choice: ReplayChoice) -> FoxgloveExport:
    own = scenario_of(log)
    if own is not None and recorded_links(log, choice):
        scenario, made = own, RECORDED
    else:
        done = replayed(log, choice)
        scenario, made = done.scenario, _made(log, done, choice)
    exported = write_foxglove(log, scenario, folder / FILE, made)
    links = links_of(scenario)
    chosen = [link for link in links if link.follower == choice.follower]
    write_layouts(folder, (chosen or links)[0])
    return exported


def _made(log: Log, done: Replayed, choice: ReplayChoice) -> Made:
    instead = frozenset(link_topics(played.link).estimate for played in done.played)
    if choice.chart is None:
        return Made(_estimates(done), instead)
    return Made(_of_foreign(log, done, done.scenario, choice), instead, alone=True)


def _estimates(done: Replayed) -> Iterator[Outgoing]:
    """Estimates that were made anew, by when they were."""
    return merge(
        *(
            [
                outgoing(link_topics(played.link).estimate, each, to_ns(each.computed))
                for each in run_data.estimates
            ]
            for run_data, played in zip(done.runs, done.played, strict=True)
        ),
        key=lambda each: each.stamp_ns,
    )


def _of_foreign(log: Log, done: Replayed, scenario: Scenario, choice: ReplayChoice) -> Iterator[Outgoing]:
    """Frames and motions of another lab as ours, and the estimates, at times of the log.

    Where the stamps of that lab run on another clock, the inputs were shifted; they are put back.
    """
    chart = load_topic_map(choice.chart or "", choice.leader, choice.follower, choice.overrides)
    types = types_of(scenario)
    inputs = [
        Outgoing(event.topic, types[event.topic], event.payload, at_ns)
        for event, at_ns in foreign_inputs(log, chart).events
    ]
    first_ns = inputs[0].stamp_ns if inputs else 0
    start_ns, end_ns = log.start_ns or first_ns, log.end_ns or first_ns
    shift_ns = 0 if start_ns <= first_ns <= end_ns else start_ns - first_ns
    for each in merge(inputs, _estimates(done), key=lambda each: each.stamp_ns):
        yield Outgoing(each.topic, each.typename, each.payload, each.stamp_ns + shift_ns)
