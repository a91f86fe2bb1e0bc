"""When a mocap frame was captured, by the host's clock: by its stamp, or by what is seen of its clock."""

from __future__ import annotations

from typing import NamedTuple

from controllers.guard import CLOCK_TOLERANCE_NS
from estimation.time.clock import heard, jitter
from estimation.time.delay_line import Arrival
from estimation.time.host_time import HostTime, TimeRows, on_host
from formation.kernel import kernel
from hil.nodes.refusals import BAD_STAMP, CLOCK_JUMP, CLOCK_UNKNOWN, NOT_REFUSED
from hil.scenario.files import refuse_two_corrections
from hil.scenario.schema import Scenario
from hil.wire.records import Frame


class TimeRules(NamedTuple):
    """How the time of a frame is told.

    ``trusted``: by its stamp, less ``offset_ns``; else on the host's clock, of which the way takes
    ``latency_ns``.
    """

    trusted: bool
    latency_ns: int
    offset_ns: int


class Timed(NamedTuple):
    """Capture of a frame by the host's clock, or by what number the frame is refused.

    ``restart``: the stamps jumped, so that what was tracked before does not go on.
    """

    times: HostTime
    capture_ns: int
    refusal: int
    restart: bool


def time_rules(scenario: Scenario) -> TimeRules:
    """How a scenario tells the time of a frame.

    Raises :class:`UsageError` as :func:`hil.scenario.files.refuse_two_corrections`.
    """
    refuse_two_corrections(scenario)
    given = scenario.estimator
    return TimeRules(
        given.clock == "trusted",
        round(given.transport_latency_s * 1e9),
        round(given.stamp_offset_s * 1e9),
    )


@kernel
def time_of(times: HostTime, rows: TimeRows, rules: TimeRules, frame: Frame, now_ns: int) -> Timed:
    """Time of a frame received at ``now_ns``, and what is known of the clock after it.

    A frame is refused by cause: bad_stamp (trusted, and in the future, or before 1970), clock_unknown
    (estimated, at the begin), clock_jump (estimated, while it may have jumped).
    """
    arrival = Arrival(frame.frame_number, frame.capture_ns, now_ns)
    if rules.trusted:
        clock = heard(times.clock, rows.clock, arrival)
        capture_ns = frame.capture_ns - rules.offset_ns
        possible = capture_ns >= 0 and capture_ns <= now_ns + CLOCK_TOLERANCE_NS
        refusal = NOT_REFUSED if possible else BAD_STAMP
        return Timed(times._replace(clock=clock), capture_ns, refusal, clock.jumps > times.clock.jumps)
    mapped = on_host(times, rows, arrival, rules.latency_ns)
    if mapped.known:
        return Timed(mapped.times, mapped.host_ns, NOT_REFUSED, False)
    doubted = mapped.times.clock.suspects > 0 or mapped.times.clock.jumps > 0
    return Timed(mapped.times, 0, CLOCK_JUMP if doubted else CLOCK_UNKNOWN, False)


def clock_report(times: HostTime, rows: TimeRows) -> dict[str, object]:
    """What is known of the clock, as values of a diagnostics message; the errors hold 99 times in 100."""
    clock, line = times.clock, times.clock.line
    if clock.offset is None:
        return {}
    values: dict[str, object] = {
        "clock.offset_ms": round(1e3 * clock.offset, 4),
        "clock.offset_error_ms": round(1e3 * line.error, 4),
        "clock.jumps": clock.jumps,
    }
    if clock.drift is not None:
        values["clock.drift_ppm"] = round(1e6 * clock.drift, 3)
        values["clock.drift_error_ppm"] = round(1e6 * line.slope_error, 3)
    if found := jitter(clock, rows.clock):
        named = {"p50": found.p50, "p99": found.p99, "max": found.largest}
        values |= {f"clock.jitter_ms.{name}": round(1e3 * value, 4) for name, value in named.items()}
    return values
