"""What may have begun is in what an estimate says of itself, by how likely it is, and only then."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from estimation.filters.gaussian import Gaussian
from estimation.models.coordinated_turn import LeaderLimits, ProcessNoise
from estimation.tracking.begun_jump import borne
from estimation.tracking.manoeuvre import (
    LASTS,
    SPEED_ALARM,
    SPEED_RAISED,
    TURN_ALARM,
    TURN_RAISED,
    Manoeuvre,
    steady,
)

LIMITS = LeaderLimits(v_eps=0.04, k_v=0.1, k_u=0.7)
NOISE = ProcessNoise.by_rule(LIMITS, 0.1, 1e-4)
FRAME, LONG = 1.0 / 120.0, 1e6
angles = st.floats(-math.pi, math.pi)


def believed(heading: float) -> Gaussian:
    mean = np.array([0.0, 0.0, 0.08 * math.cos(heading), 0.08 * math.sin(heading), 0.0])
    return Gaussian.of(mean, np.diag([1e-8, 1e-8, 1e-8, 1e-8, 1e-2]))


def watched(**signs: float) -> Manoeuvre:
    """Signs of a run in a track that is settled for so long that no jump has been seen for ever."""
    return steady()._replace(watched=LONG, running=0.05, turning=0.1, **signs)


@given(angles, st.floats(0.0, 3.0), st.floats(0.0, 1.5))
def test_without_evidence_the_belief_goes_out_as_it_is(heading: float, along: float, across: float) -> None:
    belief = believed(heading)
    assert borne(belief, watched(ahead=along, left=across), NOISE, LIMITS, FRAME) == belief


@given(angles, st.sampled_from(["ahead", "behind"]))
def test_at_an_alarm_a_jump_of_the_speed_is_as_likely_as_not(heading: float, side: str) -> None:
    belief = believed(heading)
    told = borne(belief, watched(**{side: SPEED_ALARM}), NOISE, LIMITS, FRAME)
    ahead = np.array([math.cos(heading), math.sin(heading)])
    grown = told.covariance[2:4, 2:4] - belief.covariance[2:4, 2:4]
    size = (SPEED_RAISED * LIMITS.k_v**2 - NOISE.q_v) * 0.05
    assert ahead @ grown @ ahead == pytest.approx(0.5 * size, rel=0.01)
    assert grown @ np.array([-ahead[1], ahead[0]]) == pytest.approx(np.zeros(2), abs=1e-12)
    assert told._replace(vx_vx=belief.vx_vx, vx_vy=belief.vx_vy, vy_vy=belief.vy_vy) == belief


@given(angles, st.sampled_from(["left", "right"]))
def test_at_an_alarm_a_jump_of_the_turn_rate_is_as_likely_as_not(heading: float, side: str) -> None:
    belief = believed(heading)
    told = borne(belief, watched(**{side: TURN_ALARM}), NOISE, LIMITS, FRAME)
    size = (TURN_RAISED * LIMITS.k_u**2 - NOISE.q_u) * 0.1
    assert told.u_u - belief.u_u == pytest.approx(0.5 * size, rel=0.01)
    assert np.linalg.eigvalsh(told.covariance - belief.covariance).min() > -1e-12
    assert told.mean == pytest.approx(belief.mean)


@given(st.floats(0.0, SPEED_ALARM), st.floats(0.0, 10.0))
def test_who_is_known_to_jump_needs_less_evidence(along: float, jumps: float) -> None:
    """Likewise who has not been watched for long; and never is an estimate made surer than it is."""
    belief = believed(0.3)

    def variance(manoeuvre: Manoeuvre) -> float:
        told = borne(belief, manoeuvre, NOISE, LIMITS, FRAME)
        return told.vx_vx + told.vy_vy

    calm = watched(ahead=along)._replace(watched=20.0)
    assert variance(calm._replace(jumps=jumps)) >= variance(calm) >= variance(watched(ahead=along))
    assert variance(calm._replace(watched=2.0)) >= variance(calm)
    assert variance(watched(ahead=along)) >= belief.vx_vx + belief.vy_vy


def test_after_an_alarm_the_belief_knows_by_itself() -> None:
    belief, signs = believed(0.3), watched(ahead=SPEED_ALARM, left=TURN_ALARM)
    assert (
        borne(belief, signs._replace(speed_raised=LASTS, turn_raised=LASTS), NOISE, LIMITS, FRAME) == belief
    )
