"""What a log tells of a follower, as columns: its estimates and commands, and the truth where it is known."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimation.tracking.tracker import Status
from formation.records import dtype_of
from hil.judge.columns import true_states
from hil.judge.run_data import RunData, Span, evaluation_span, run_data_of_kept
from hil.judge.true_states import Stamps, TrueStates
from hil.log.cdr_columns import Array, Lists, columns_of, fields_of
from hil.log.reader import Log, Record
from hil.nodes.findings import Findings
from hil.nodes.troubles import troubles_in
from hil.replay.kept import Kept, KeptReplay
from hil.replay.kept_rows import EstimateRow, TruthRow
from hil.replay.node_reports import LastReports
from hil.scenario.links import Link
from hil.wire import message_types as msg
from hil.wire import topics
from hil.wire.messages import MalformedPayloadError, encode, known_types, typename_of, typestore_of
from hil.wire.topics import link_topics

_AT_ONCE = 1 << 14
DIAGONAL = 6
"""One in so many entries of an estimate's covariance is a variance."""

Table = Mapping[str, Array]
"""Numbers and texts of messages by their fields' names, times in ns; without lists."""


@dataclass(frozen=True, slots=True, eq=False)
class Refusals:
    """What the estimator reported as refused: the counts by cause (texts), and when [ns] it did."""

    at_ns: Stamps
    totals: NDArray[np.float64]
    causes: Sequence[str]


@dataclass(frozen=True, slots=True, eq=False)
class LoggedRun:
    """A follower's messages as columns in the order of their stamps.

    ``zero_ns``: where t_run counts from; ``evaluation``: the span that the judge looks at.
    """

    follower: str
    zero_ns: int
    evaluation: Span
    estimates: Table
    commands: Table
    certified: Table
    truth: TrueStates
    refusals: Refusals | None


def recorded_run(log: Log, link: Link) -> LoggedRun:
    """A follower's run as it was recorded. Raises :class:`UsageError` as :meth:`Log.records`."""
    names = link_topics(link)
    kinds = {
        names.estimate: msg.LeaderEstimate,
        names.command: msg.Command,
        names.certified: msg.CertifiedEstimate,
        names.truth: msg.Truth,
    }
    gathered = {topic: _Gathered(log, topic, typename_of(kind)) for topic, kind in kinds.items()}
    reports, refusals = LastReports(log), _Refusals(log, link)
    stopped_ns = None
    wanted = [topic for topic in (*kinds, topics.DIAGNOSTICS, topics.STOP) if topic in log.topics]
    for record in log.records(wanted):
        if record.topic == topics.STOP:
            stopped_ns = record.log_ns if stopped_ns is None else stopped_ns
        elif record.topic == topics.DIAGNOSTICS:
            reports.hear(record.payload)
            refusals.hear(record)
        else:
            gathered[record.topic].add(record.payload)
    tables = {topic: each.table() for topic, each in gathered.items()}
    estimates, truths = _sound_estimates(tables[names.estimate]), tables[names.truth]
    kept = _kept(_estimate_rows(estimates), _truth_rows(truths), reports, stopped_ns)
    run_data = run_data_of_kept(log, KeptReplay(link, kept, {}, {}))
    return LoggedRun(
        link.follower,
        run_data.zero_ns,
        evaluation_span(run_data),
        estimates,
        tables[names.command],
        tables[names.certified],
        true_states(run_data),
        refusals.done(),
    )


def replayed_run(run_data: RunData) -> LoggedRun:
    """A follower's run as a replay has made it anew, in messages."""
    return LoggedRun(
        run_data.scenario.follower.name,
        run_data.zero_ns,
        evaluation_span(run_data),
        _sound_estimates(_table_of(msg.LeaderEstimate, run_data.estimates)),
        _table_of(msg.Command, run_data.commands),
        _table_of(msg.CertifiedEstimate, run_data.certified),
        true_states(run_data),
        None,
    )


class _Gathered:
    """Takes payloads of a topic in, and keeps their columns; none of a topic of another type."""

    def __init__(self, log: Log | None, topic: str, typename: str) -> None:
        text = log.definitions.get(typename) if log is not None else None
        self._store = typestore_of(typename, text) if text else known_types()
        self._typename = typename
        self._taken = log is None or log.topics.get(topic) == typename
        self._fields = fields_of(self._store, typename)
        self._payloads: list[bytes] = []
        self._parts: list[dict[str, Array]] = []

    def add(self, payload: bytes) -> None:
        self._payloads.append(payload)
        if len(self._payloads) >= _AT_ONCE:
            self._decode()

    def table(self) -> Table:
        self._decode()
        # Column by column, so that there is never twice as much of it.
        names = list(self._parts[0])
        return {name: np.concatenate([part.pop(name) for part in self._parts]) for name in names}

    def _decode(self) -> None:
        payloads, self._payloads = (self._payloads if self._taken else []), []
        found = columns_of(self._store, self._typename, payloads)
        part = {
            field.name: values
            for field, values in zip(self._fields, found.values, strict=True)
            if not isinstance(values, Lists) and not _is_off_diagonal(field.name)
        }
        times = [part[field.name] for field in self._fields if field.is_time and field.name in part]
        right = np.all([at >= 0 for at in times], axis=0)
        self._parts.append({name: values[right] for name, values in part.items()})


def _is_off_diagonal(name: str) -> bool:
    field, _, number = name.partition(".")
    return field == "covariance" and int(number) % DIAGONAL != 0


def _table_of(kind: type[msg.Message], messages: Iterable[msg.Message]) -> Table:
    gathered = _Gathered(None, "", kind.__msgtype__)
    for message in messages:
        gathered.add(encode(message))
    return gathered.table()


def _sound_estimates(estimates: Table) -> Table:
    known = estimates["status"] <= max(Status)
    return {name: values[known] for name, values in estimates.items()}


def _estimate_rows(table: Table) -> NDArray[np.void]:
    """Rows of which the judge knows when the run was; all else is not looked at."""
    rows = np.zeros(len(table["rho"]), dtype=dtype_of(EstimateRow))
    rows["capture_ns"] = table["header.stamp"]
    return rows


def _truth_rows(table: Table) -> NDArray[np.void]:
    rows = np.zeros(len(table["v1"]), dtype=dtype_of(TruthRow))
    for name in TruthRow._fields:
        rows[name] = table["header.stamp" if name == "capture_ns" else name]
    return rows


def _kept(
    estimates: NDArray[np.void], truths: NDArray[np.void], reports: LastReports, stopped_ns: int | None
) -> Kept:
    none = np.zeros(0, dtype=[("number", np.int64), ("capture_ns", np.int64)])
    found: Mapping[str, Findings] = {}
    return Kept(estimates, none, truths, none, none, none, (), reports.values() or {}, stopped_ns, found)


class _Refusals:
    """Hears the reports of a follower's estimator."""

    def __init__(self, log: Log, link: Link) -> None:
        self._log = log
        self._name = link.node_name("estimator")
        self._heard: list[tuple[int, float, str]] = []

    def hear(self, record: Record) -> None:
        if self._name.encode() not in record.payload:
            return
        try:
            report = self._log.decode(record)
            told = troubles_in(report) if isinstance(report, msg.DiagnosticArray) else {}
        except MalformedPayloadError:
            return
        if (trouble := told.get(self._name)) is not None:
            causes = ", ".join(f"{cause} {count}" for cause, count in trouble.refused.items())
            self._heard.append((record.log_ns, float(sum(trouble.refused.values())), causes))

    def done(self) -> Refusals | None:
        if not self._heard:
            return None
        at_ns, totals, causes = zip(*self._heard, strict=True)
        return Refusals(np.array(at_ns, dtype=np.int64), np.array(totals), causes)
