"""When a frame was captured, for those who need to know it to some hundredths of a second only."""

from __future__ import annotations

from hil.scenario.schema import EstimatorSection

_LIKELY_NS = 1_000_000_000


def captured_ns(given: EstimatorSection, stamp_ns: int, now_ns: int) -> int:
    """When a frame was captured that comes now, by the host's clock.

    By its stamp if that is trusted and can be of this clock, else by the way that it is known to take.
    """
    stamped_ns = stamp_ns - round(given.stamp_offset_s * 1e9)
    if given.clock == "trusted" and abs(stamped_ns - now_ns) < _LIKELY_NS:
        return stamped_ns
    return now_ns - round(given.transport_latency_s * 1e9)
