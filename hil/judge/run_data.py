"""What a run leaves behind for its judge: estimates, commands, the truth where it is known, and counts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

import numpy as np

from estimation.time.delay_line import Arrival
from hil.errors import UsageError
from hil.judge.findings import of_follower
from hil.judge.frames import Frames, Numbered, frames_of
from hil.judge.made_by import law_facts
from hil.judge.mocap_truth import MocapTracks, tracks_of
from hil.judge.side_orders import Order, orders_of
from hil.judge.sound_messages import is_sound
from hil.log.metadata import (
    IMPORT,
    LIVE,
    mode_of,
    recorded_certificate,
    scenario_of,
    truth_is_of_bodies,
)
from hil.log.origin import Origin, origin_of
from hil.log.reader import Log, Record
from hil.nodes.findings import Findings, all_found, findings_in
from hil.nodes.noise_report import scale_in
from hil.nodes.troubles import Trouble, troubles_of
from hil.replay.kept import Kept, KeptReplay
from hil.scenario.certificate import certificate_json, certificate_of
from hil.scenario.certify import same_steps
from hil.scenario.links import STARTERS, Link
from hil.scenario.schema import Scenario
from hil.wire import topics
from hil.wire.events import digest
from hil.wire.message_types import (
    CertifiedEstimate,
    Command,
    DiagnosticArray,
    LeaderEstimate,
    Message,
    RigidBodies,
    String,
    Truth,
)
from hil.wire.messages import MalformedPayloadError, to_ns
from hil.wire.topics import Topics, link_topics

M = TypeVar("M", bound=Message)


@dataclass(frozen=True, slots=True)
class LogFacts:
    """The log that the run data comes from: its path, its messages, its size."""

    path: str
    messages: int
    bytes: int


@dataclass(frozen=True, slots=True, eq=False)
class RunData:
    """All that :func:`hil.judge.summary.summarise` looks at; messages in the order of their publication.

    ``taken``, ``refused``: the estimator's counts, by kind and by cause. ``zero_ns``: where the run's time in
    seconds counts from. ``motion_since_ns``: when the leader of a run set off, None for other recordings.
    ``stopped_ns``: when the first stop was ordered, None for none. ``evaluate_from_ns``,
    ``evaluate_to_ns``: limits of the evaluation that take the place of those in the scenario. ``frames`` and
    ``log``: None where they are not known. ``arrivals``: all frames that the estimator could read, as they
    came. ``certified``: estimates with guaranteed radii, where these were asked for. ``certificate``: what
    the log carries for this very scenario, None if it is to be worked out.
    ``orders``: to change sides, as they were given. ``kept``: what a replay in one pass has kept, in the
    place of estimates, commands, truth and arrivals, which are empty then. ``law``: what is to be said of a
    law of one's own. ``noise_scale``: noise of positions as it was found over what was told, None if it was
    not looked for. ``found``: findings by the nodes' names, None where no node could have told any.
    ``troubles``: what the estimator reported of its inputs over time.
    ``truth_of_bodies``: whether the truth in the log is of rigid bodies and not of the robots below.
    ``origin``: what the log tells of how it was made.
    ``tracks``: in the place of a truth that nobody knows, what the motion capture showed of a run with robots
    that exist.

    A replay is judged on the run data of its log with its own estimates and counts put in by
    :func:`dataclasses.replace`.
    """

    scenario: Scenario
    mode: str
    estimates: Sequence[LeaderEstimate]
    commands: Sequence[Command] = ()
    truth: Sequence[Truth] = ()
    taken: Mapping[str, int] = field(default_factory=dict)
    refused: Mapping[str, int] = field(default_factory=dict)
    zero_ns: int = 0
    motion_since_ns: int | None = None
    stopped_ns: int | None = None
    evaluate_from_ns: int | None = None
    evaluate_to_ns: int | None = None
    frames: Frames | None = None
    arrivals: Sequence[Arrival] = ()
    certified: Sequence[CertifiedEstimate] = ()
    log: LogFacts | None = None
    certificate: Mapping[str, Any] | None = None
    orders: Sequence[Order] = ()
    kept: Kept | None = None
    law: Mapping[str, Any] = field(default_factory=dict)
    noise_scale: float | None = None
    found: Mapping[str, Findings] | None = None
    troubles: Sequence[Trouble] = ()
    truth_of_bodies: bool = False
    tracks: MocapTracks | None = None
    origin: Origin = field(default_factory=Origin)


@dataclass(frozen=True, slots=True)
class Span:
    """From when to when, both included [ns]."""

    from_ns: int
    to_ns: int

    @property
    def seconds(self) -> float:
        """Its length [s]."""
        return (self.to_ns - self.from_ns) / 1e9


def run_span(run_data: RunData) -> Span:
    """From when the leader set off to the stop or the end of the scenario's duration, whichever is first.

    For a recording in which no emulated leader sets off: from the first to the last of its captures.
    """
    captures = captured(run_data)
    if run_data.motion_since_ns is None:
        return captures or Span(run_data.zero_ns, run_data.zero_ns)
    since_ns = run_data.motion_since_ns
    last_ns = captures.to_ns if captures else since_ns
    ends = [since_ns + round(run_data.scenario.run.duration_s * 1e9), last_ns]
    if run_data.stopped_ns is not None:
        ends.append(run_data.stopped_ns)
    return Span(since_ns, max(since_ns, min(ends)))


def evaluation_span(run_data: RunData) -> Span:
    """What is judged: what the run data asks for, else the run from ``run.evaluate_from_s`` on.

    Of a run that does not last that long the second half is judged.
    """
    run = run_span(run_data)
    to_ns = run.to_ns if run_data.evaluate_to_ns is None else run_data.evaluate_to_ns
    from_ns = run_data.evaluate_from_ns
    if from_ns is None:
        from_ns = judged_from_ns(run_data.scenario, run_data.zero_ns, Span(run.from_ns, to_ns))
    return Span(from_ns, to_ns)


def judged_from_ns(scenario: Scenario, zero_ns: int, run: Span) -> int:
    """From when on a run is judged whose time in seconds counts from ``zero_ns``."""
    from_ns = zero_ns + round(scenario.run.evaluate_from_s * 1e9)
    return from_ns if from_ns < run.to_ns else (run.from_ns + run.to_ns) // 2


def run_data_of_log(log: Log, scenario: Scenario | None = None) -> RunData:
    """Run data of what a log recorded, judged by the given scenario or by the log's own.

    Its time in seconds counts from when the leader set off; in an imported log from the source's own zero,
    and in any other from the first stamp. Raises :class:`UsageError` for a log without a scenario if none is
    given, and as :meth:`Log.records`. Payloads that are not what their topic promises are left out.
    """
    own = scenario_of(log)
    scenario = scenario or own
    if scenario is None:
        raise UsageError(f"log {log.path}: does not tell its scenario; give one, or a map that names one")
    run_data = run_data_of_link(log, Link(scenario))
    return replace(run_data, certificate=own_certificate(log, scenario))


def own_certificate(log: Log, scenario: Scenario) -> Mapping[str, Any] | None:
    """The certificate that a log carries for this very scenario, None if it is to be worked out."""
    own = scenario_of(log)
    same = own is not None and same_steps(scenario, own)
    return recorded_certificate(log) if same else None


def run_data_of_link(log: Log, link: Link) -> RunData:
    """Run data of what a log recorded of one follower of a chain, or of a pair.

    For a predecessor that no program drives the certificate is there: it assumes the limits alone. In a chain
    nobody takes orders to change sides.
    """
    scenario, names = link.scenario, link_topics(link)
    records = _records(log, names)
    reports = _decoded(log, records[topics.DIAGNOSTICS], DiagnosticArray)
    counts = _last_counts(reports)
    estimator = counts.get(link.node_name("estimator"), {})
    estimates = _decoded(log, records[names.estimate], LeaderEstimate)
    truth = _decoded(log, records[names.truth], Truth)
    arrivals = _arrivals(log, records[topics.RIGID_BODIES], estimates)
    mode = mode_of(log) or IMPORT
    run_data = RunData(
        scenario=scenario,
        mode=mode,
        truth_of_bodies=truth_is_of_bodies(log),
        tracks=tracks_of(log, link) if mode == LIVE and not truth else None,
        estimates=estimates,
        commands=_decoded(log, records[names.command], Command),
        truth=truth,
        taken=_group(estimator, "taken"),
        refused=_group(estimator, "refused"),
        motion_since_ns=_set_off_ns(counts),
        stopped_ns=records[topics.STOP][0].log_ns if records[topics.STOP] else None,
        frames=_frames(scenario, arrivals, truth),
        arrivals=arrivals,
        orders=() if link.in_chain else orders_of(scenario, _timed(log, records[names.side], String)),
        certified=_decoded(log, records[names.certified], CertifiedEstimate),
        log=_facts(log),
        origin=origin_of(log),
        certificate=None if link.first else certificate_json(certificate_of(scenario, driven=False)),
        law=law_facts(log, counts.get(link.node_name("controller"), {})),
        noise_scale=scale_in(estimator),
        found=of_follower(all_found(map(findings_in, reports)), link) if reports else None,
        troubles=troubles_of(reports, link.node_name("estimator")),
    )
    return replace(run_data, zero_ns=_zero_ns(log, run_data))


def run_data_of_kept(log: Log, replay: KeptReplay) -> RunData:
    """Run data of what a replay in one pass has kept of a follower; see :func:`run_data_of_link`."""
    link, kept = replay.link, replay.kept
    mode = mode_of(log) or IMPORT
    sides = [_side_of(log, link, each) for each in kept.sides]
    run_data = RunData(
        scenario=link.scenario,
        mode=mode,
        truth_of_bodies=truth_is_of_bodies(log),
        tracks=tracks_of(log, link) if mode == LIVE and not len(kept.truths) else None,
        estimates=(),
        taken=replay.taken,
        refused=replay.refused,
        motion_since_ns=_set_off_ns(kept.reports),
        stopped_ns=kept.stopped_ns,
        frames=frames_of(
            link.scenario,
            Numbered(kept.arrivals["number"], kept.arrivals["capture_ns"]),
            Numbered(kept.truths["frame_number"], kept.truths["capture_ns"]),
        ),
        orders=() if link.in_chain else orders_of(link.scenario, [each for each in sides if each]),
        log=_facts(log),
        origin=origin_of(log),
        certificate=None if link.first else certificate_json(certificate_of(link.scenario, driven=False)),
        law=law_facts(log, kept.reports.get(link.node_name("controller"), {})),
        kept=kept,
        noise_scale=replay.noise_scale,
        found=of_follower(kept.found, link) if kept.reports else None,
        troubles=kept.troubles.get(link.node_name("estimator"), ()),
    )
    return replace(run_data, zero_ns=_zero_ns(log, run_data))


def _side_of(log: Log, link: Link, logged: tuple[int, bytes]) -> tuple[int, String] | None:
    topic, (log_ns, payload) = link_topics(link).side, logged
    found = _timed(log, [Record(topic, log.topics.get(topic, ""), payload, log_ns, log_ns, 0)], String)
    return found[0] if found else None


def _facts(log: Log) -> LogFacts:
    path = str(log.path).encode(errors="replace").decode()
    return LogFacts(path, log.messages, log.size_bytes())


def _zero_ns(log: Log, run_data: RunData) -> int:
    if run_data.motion_since_ns is not None:
        return run_data.motion_since_ns
    if mode_of(log) == IMPORT:
        return 0
    captures = captured(run_data)
    return captures.from_ns if captures else log.start_ns or 0


def captured(run_data: RunData, *, truth: bool = True) -> Span | None:
    """The first and the last capture that an estimate or, if asked, a truth is about, None without any."""
    kept = run_data.kept
    if kept is not None:
        found = [rows["capture_ns"] for rows in (kept.estimates, kept.truths)[: 1 + truth] if len(rows)]
        spans = [(int(each.min()), int(each.max())) for each in found]
    else:
        headers = [each.header for each in run_data.estimates]
        headers += [each.header for each in run_data.truth] if truth else []
        spans = [(at, at) for at in (to_ns(header.stamp) for header in headers)]
    if not spans:
        return None
    return Span(min(first for first, _ in spans), max(last for _, last in spans))


def _records(log: Log, names: Topics) -> dict[str, list[Record]]:
    wanted = (
        topics.RIGID_BODIES,
        names.truth,
        topics.DIAGNOSTICS,
        topics.STOP,
        names.estimate,
        names.certified,
        names.command,
        names.side,
    )
    records: dict[str, list[Record]] = {topic: [] for topic in wanted}
    for record in log.records([topic for topic in wanted if topic in log.topics]):
        records[record.topic].append(record)
    return records


def _decoded(log: Log, records: Sequence[Record], kind: type[M]) -> list[M]:
    return [message for _, message in _timed(log, records, kind)]


def _timed(log: Log, records: Sequence[Record], kind: type[M]) -> list[tuple[int, M]]:
    """Messages of a kind with the time of their record; what cannot be decoded or be is left out."""
    messages: list[tuple[int, M]] = []
    for record in records:
        try:
            message = log.decode(record)
        except MalformedPayloadError:
            continue
        if isinstance(message, kind) and is_sound(message):
            messages.append((record.log_ns, message))
    return messages


def _last_counts(reports: Sequence[DiagnosticArray]) -> dict[str, dict[str, str]]:
    """Values of the last report of every node, by the node's name."""
    return {
        status.name.removeprefix("abreast/"): {entry.key: entry.value for entry in status.values}
        for report in reports
        for status in report.status
    }


def _set_off_ns(reports: Mapping[str, Mapping[str, str]]) -> int | None:
    """When the leader set off, by who let it: the emulator, or the daemon of a real one."""
    told = (reports.get(node, {}).get("motion_since_ns", "") for node in STARTERS)
    return next((int(text) for text in told if _is_count(text)), None)


def _group(values: Mapping[str, str], group: str) -> dict[str, int]:
    prefix = f"{group}."
    return {
        key.removeprefix(prefix): int(text)
        for key, text in values.items()
        if key.startswith(prefix) and _is_count(text)
    }


def _is_count(text: str) -> bool:
    return text.isdecimal() and len(text) <= len(str(2**62))


def _arrivals(log: Log, records: Sequence[Record], estimates: Sequence[LeaderEstimate]) -> list[Arrival]:
    """Frames that the estimator got, in the order in which it did.

    Those are the ones that its estimates have receipts for; in a log without estimates all, as logged.
    """
    got = {each.digest: to_ns(each.received) for estimate in estimates for each in estimate.consumed}
    names = [digest(record.topic, record.payload) for record in records]
    received = [
        (got.get(name, record.log_ns), record)
        for name, record in zip(names, records, strict=True)
        if name in got or not estimates
    ]
    return [
        Arrival(frame.frame_number, to_ns(frame.header.stamp), receive_ns)
        for receive_ns, record in sorted(received, key=lambda item: item[0])
        for frame in _decoded(log, [record], RigidBodies)
    ]


def _frames(scenario: Scenario, arrivals: Sequence[Arrival], truth: Sequence[Truth]) -> Frames | None:
    arrived = [(each.number, each.capture_ns) for each in arrivals]
    true = [(each.frame_number, to_ns(each.header.stamp)) for each in truth]
    found = frames_of(scenario, _numbered(arrived), _numbered(true))
    return None if found is None else Frames(found.published, np.asarray(found.captures_ns).tolist())


def _numbered(captures: Sequence[tuple[int, int]]) -> Numbered:
    numbers, at_ns = np.array(captures, dtype=np.int64).reshape(-1, 2).T
    return Numbered(numbers, at_ns)
