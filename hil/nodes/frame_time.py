"""When a mocap frame was captured, by the host's clock: by its stamp, or by what is seen of its clock."""

from __future__ import annotations

from dataclasses import dataclass

from estimation.time.clock import Arrival, heard
from estimation.time.host_time import HostTime, on_host
from hil.scenario.files import refuse_two_corrections
from hil.scenario.schema import Scenario
from hil.wire.message_checks import CLOCK_TOLERANCE_NS
from hil.wire.records import Frame


@dataclass(frozen=True, slots=True)
class Timed:
    """Capture of a frame by the host's clock, or why the frame is refused.

    ``restart``: the stamps jumped, so that what was tracked before does not go on.
    """

    times: HostTime
    capture_ns: int
    refusal: str = ""
    restart: bool = False


class FrameTime:
    """How a scenario tells the time of a frame. Holds no state of its own between calls.

    Raises :class:`UsageError` as :func:`hil.scenario.files.refuse_two_corrections`.
    """

    def __init__(self, scenario: Scenario) -> None:
        given = scenario.estimator
        refuse_two_corrections(scenario)
        self.trusted = given.clock == "trusted"
        self.latency_ns = round(given.transport_latency_s * 1e9)
        self.offset_ns = round(given.stamp_offset_s * 1e9)

    def of(self, times: HostTime, frame: Frame, now_ns: int) -> Timed:
        """Time of a frame received at ``now_ns``, and what is known of the clock after it.

        A frame is refused by cause: bad_stamp (trusted, and in the future, or before 1970), clock_unknown
        (estimated, at the begin), clock_jump (estimated, while it may have jumped).
        """
        arrival = Arrival(frame.frame_number, frame.capture_ns, now_ns)
        if self.trusted:
            clock = heard(times.clock, arrival)
            jumped = clock.jumps > times.clock.jumps
            capture_ns = frame.capture_ns - self.offset_ns
            refusal = "" if 0 <= capture_ns <= now_ns + CLOCK_TOLERANCE_NS else "bad_stamp"
            return Timed(HostTime(clock), capture_ns, refusal, restart=jumped)
        after, mapped_ns = on_host(times, arrival, self.latency_ns)
        if mapped_ns is None:
            doubted = after.clock.suspects or after.clock.jumps
            return Timed(after, 0, "clock_jump" if doubted else "clock_unknown")
        return Timed(after, mapped_ns)

    def report(self, times: HostTime) -> dict[str, object]:
        """What is known of the clock, as values of a diagnostics message; the errors hold 99 times in 100."""
        clock, line = times.clock, times.clock.line
        if line is None or clock.offset is None:
            return {}
        values: dict[str, object] = {
            "clock.offset_ms": round(1e3 * clock.offset, 4),
            "clock.offset_error_ms": round(1e3 * line.error, 4),
            "clock.jumps": clock.jumps,
        }
        if clock.drift is not None:
            values["clock.drift_ppm"] = round(1e6 * clock.drift, 3)
            values["clock.drift_error_ppm"] = round(1e6 * line.slope_error, 3)
        if jitter := clock.jitter():
            named = {"p50": jitter.p50, "p99": jitter.p99, "max": jitter.largest}
            values |= {f"clock.jitter_ms.{name}": round(1e3 * value, 4) for name, value in named.items()}
        return values
