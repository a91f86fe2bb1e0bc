"""What the daemons write, against the general codec: the same bytes, message after message in one writer."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from estimation.bounds.window_velocity import NO_WINDOW
from estimation.tracking.estimate import Estimate, Joint
from estimation.tracking.track_point import NO_JUMP
from estimation.tracking.tracker import Status
from formation.pose import Motion
from formation.records import row_of
from hil.scenario.files import load_scenario
from hil.wire import message_types as msg
from hil.wire.assumed_errors import AssumedErrors, bounds_of
from hil.wire.messages import encode, header, to_time
from hil.wire.records import Receipt
from hil.wire.writing import DriveWriter, EstimateWriter

ASSUMED = AssumedErrors.of(load_scenario("turtlebot3"))
REASONS = ("", "no measurement of late", "längst verloren")

moments = st.integers(0, (2**31 - 1) * 10**9)
numbers = st.floats(-1e3, 1e3)
estimates = st.builds(
    Estimate,
    capture_ns=moments,
    measured_ns=moments,
    rho=st.floats(0.01, 100.0),
    alpha2=numbers,
    rho_dot=numbers,
    alpha2_dot=numbers,
    v1=st.floats(0.0, 10.0),
    alpha1=numbers,
    u1=numbers,
    v2=numbers,
    u2=numbers,
    joint=st.builds(Joint, *[st.floats()] * 15),
    nis=st.floats(),
    status=st.sampled_from([status.value for status in Status]),
    jump=st.just(NO_JUMP),
)


def receipt_of(digest: int, received_ns: int) -> Receipt:
    """Receipt of an input by its digest, an unsigned number."""
    return Receipt(digest - (1 << 64) if digest >> 63 else digest, received_ns)


receipts = st.lists(st.builds(receipt_of, st.integers(0, 2**64 - 1), moments), max_size=4)
told = st.tuples(estimates, st.sampled_from(range(len(REASONS))), moments, receipts)


def message_of(estimate: Estimate, reason: str, now_ns: int, consumed: list[Receipt]) -> msg.LeaderEstimate:
    bound = bounds_of(estimate, ASSUMED, NO_WINDOW)
    e, inputs = estimate, [msg.Consumed(each.digest % 2**64, to_time(each.received_ns)) for each in consumed]
    covariance = e.covariance.reshape(25)
    stamps = (header(e.capture_ns, "follower"), to_time(e.measured_ns), to_time(now_ns))
    rates = (e.rho, e.alpha2, e.rho_dot, e.alpha2_dot, e.v1, e.alpha1, e.u1, e.v2, e.u2)
    return msg.LeaderEstimate(*stamps, *rates, covariance, e.nis, e.status, reason, *bound, inputs)


@given(st.lists(told, min_size=1, max_size=3))
@settings(deadline=None, max_examples=100)
def test_estimates_are_what_the_general_codec_would_write(
    series: list[tuple[Estimate, int, int, list[Receipt]]],
) -> None:
    writer = EstimateWriter("follower", ASSUMED, REASONS)
    for estimate, reason, now_ns, consumed in series:
        expected = encode(message_of(estimate, REASONS[reason], now_ns, consumed))
        assert writer.write(row_of(estimate), reason, now_ns, consumed) == expected


@given(st.lists(st.tuples(st.floats(), st.floats(), moments), min_size=1, max_size=3), st.booleans())
@settings(deadline=None, max_examples=50)
def test_drive_commands_are_what_the_general_codec_would_write(
    series: list[tuple[float, float, int]], stamped: bool
) -> None:
    writer = DriveWriter("follower", stamped=stamped)
    for v, u, stamp_ns in series:
        twist = msg.Twist(linear=msg.Vector3(x=v, y=0.0, z=0.0), angular=msg.Vector3(x=0.0, y=0.0, z=u))
        whole = msg.TwistStamped(header=header(stamp_ns, "follower"), twist=twist) if stamped else twist
        assert writer.write(Motion(v, u), stamp_ns) == encode(whole)
        assert writer.typename == whole.__msgtype__


def test_the_largest_number_of_receipts_fits() -> None:
    writer = EstimateWriter("follower", ASSUMED, REASONS)
    consumed = [receipt_of(2**64 - 1 - k, k) for k in range(4096)]
    joint = Joint(*np.linspace(0.0, 1.0, 15).tolist())
    estimate = Estimate(1, 1, 0.2, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, joint, 0.5, 1, NO_JUMP)
    expected = encode(message_of(estimate, REASONS[2], 5, consumed))
    assert writer.write(row_of(estimate), 2, 5, consumed) == expected
