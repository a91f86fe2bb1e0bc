"""Whether a log begins after the estimator did, whose first outputs nobody can repeat then."""

from __future__ import annotations

from hil.log.events import Recorded, recorded_estimates
from hil.log.reader import Log
from hil.scenario.links import Link
from hil.wire import topics
from hil.wire.message_types import DiagnosticArray
from hil.wire.messages import MalformedPayloadError, to_ns
from hil.wire.topics import link_topics

_TAKEN = ("taken.frames", "taken.odometry")
_INSTEAD = "start the recorder first, or the daemon of the estimator with --needs recorder"


def late_recorder(log: Log, link: Link) -> str:
    """That an estimator had used inputs before anything was recorded of them; empty if the log shows none."""
    estimates = recorded_estimates(log, link_topics(link).estimate)
    came = "the recorder came later than the estimator, which had used"
    if told := _first_report(log, link.node_name("estimator")):
        at_ns, taken = told
        known = _consumed_by(estimates, at_ns)
        if taken > known:
            return (
                f"{came} {taken} inputs by its first report, and the log tells of {known} of them: {_INSTEAD}"
            )
    used_ns = min((now_ns for output in estimates[:1] for _, now_ns in output.consumed), default=None)
    if used_ns is None or log.start_ns is None or used_ns >= log.start_ns:
        return ""
    return f"{came} inputs {1e-6 * (log.start_ns - used_ns):.0f} ms before anything was recorded: {_INSTEAD}"


def _first_report(log: Log, node: str) -> tuple[int, int] | None:
    """When a node reported for the first time in a log, and how many inputs it had used by then."""
    for record in log.records([topics.DIAGNOSTICS] if topics.DIAGNOSTICS in log.topics else []):
        # Of a live log there is no need to decode what others say.
        if node.encode() not in record.payload:
            continue
        try:
            report = log.decode(record)
            if not isinstance(report, DiagnosticArray):
                continue
            at_ns = to_ns(report.header.stamp)
        except MalformedPayloadError:
            continue
        for status in report.status:
            if status.name == f"abreast/{node}":
                counts = {each.key: each.value for each in status.values}
                return at_ns, sum(int(counts[name]) for name in _TAKEN if counts.get(name, "").isdecimal())
    return None


def _consumed_by(estimates: list[Recorded], at_ns: int) -> int:
    """How many inputs estimates name that were taken in by then."""
    return sum(now_ns <= at_ns for output in estimates for _, now_ns in output.consumed)
