"""Gains for the leader-independent law: between what the leader demands and what delay and noise allow.

Near the formation, with r = rho - rho_0 and theta = alpha1 + pi/2, the reduced system under law (8) is
r' = -v theta, theta' = w^2 r / v - mu1 theta with w^2 = 2 mu_rho v^2 / rho_0. The law answers all of theta'
late, so the open loop is (mu1 s + w^2) / s^2 with the delay in front. Its crossover and phase margin are

    wc^2 = (mu1^2 + sqrt(mu1^4 + 4 w^4)) / 2,    margin = atan(mu1 wc / w^2) - wc delay,

and where both gains grow so that the damping stays (mu1 by s, mu_rho by s^2), wc grows by s. The leader's
steering says how low they may be. From there they grow until delay, noise or the speed limit says stop, each
with a reserve: within these bounds the tighter law keeps the distance better.

mu_rho has one more bound, by pairs that start far apart. A follower held at v_max with alpha2 at its place
goes round its leader: theta' = (v_max - v cos theta) / rho and rho' = -v sin theta keep
rho (v_max - v cos theta) as it is. It leaves this circle only where law (8) asks for less than v_max, so
where rho (v f - mu1 sin theta) + v cos theta is small; as f < mu_rho, there is such a place on every circle,
however far, if and only if v mu_rho <= mu1.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from controllers.gain_task import Task
from formation.invariant_set import Disturbed, invariant_set
from formation.spacing import Spacing
from formation.speed_range import SpeedRange
from formation.steering_margin import settles

PHASE_MARGIN = 0.25 * math.pi
STEERING_RESERVE = 1.1
ALPHA2_WITHIN = 0.2
_SIGMAS = 3.0
_DAMPINGS = (0.6, 0.7, 0.85, 1.0, 1.25)
_STEP, _STEPS = 1.08, 40
_PATH = 2.0
_FASTER = 1.3
_SWING = 0.5
_HAIR = 1e-9
_WHY_FROM_AFAR = "v1 mu_rho within mu1, or a pair that starts far apart may go round at v_max for ever"


@dataclass(frozen=True, slots=True)
class Bound:
    """What a gain needs at ``least`` and bears at ``most``, each with its reason."""

    least: float
    why_least: str
    most: float
    why_most: str


@dataclass(frozen=True, slots=True)
class Design:
    """Proposed gains, or None and ``why``; bounds by the name of the gain, as far as they were found.

    ``phase_margin`` [rad] with the delay that the prediction leaves; ``delay_margin`` [s] without prediction.
    ``note`` is for what works but not always.
    """

    gains: tuple[float, float, float] | None
    why: str | None
    bounds: dict[str, Bound]
    phase_margin: float
    delay_margin: float
    note: str | None


def design(task: Task) -> Design:
    """Propose mu1, mu2, mu_rho: the highest that delay, noise and limits allow, if the leader does, too."""
    why = _out_of_reach(task)
    lowest = None if why else _lowest(task)
    if lowest is None:
        why = why or (
            f"no gains keep the distance within {100.0 * task.band:g} % of rho_0 whatever a leader within "
            f"{task.k_u:g} rad/s steers"
        )
        return Design(None, why, {}, math.nan, math.nan, None)
    mu1, mu_rho, why_least = lowest
    growth, why_most = _growth(mu1, mu_rho, task)
    most1, most_rho = growth * mu1, growth * growth * mu_rho
    # The weakest law that keeps the formation is better than none, be it for pairs that start near it only.
    from_afar = max(mu_rho, most1 / task.speeds.highest)
    why_most_rho = _WHY_FROM_AFAR if from_afar < most_rho else why_most
    most_rho = min(most_rho, from_afar)
    most2, why_most2 = _most_mu2(mu1, task)
    by_error = task.M_alpha2 / math.sin(ALPHA2_WITHIN)
    mu2 = max(by_error, _FASTER * max(mu1, most1))
    bounds = {
        "mu1": Bound(mu1, why_least, most1, why_most),
        "mu_rho": Bound(mu_rho, why_least, most_rho, why_most_rho),
        "mu2": Bound(max(by_error, _FASTER * mu1), _why_mu2(by_error, mu1, task), most2, why_most2),
    }
    # What is more than mu1 bears is more than mu_rho bears: one is enough to say.
    broken = [
        f"{name} needs {bound.least:.3g} ({bound.why_least}) but bears {bound.most:.3g} ({bound.why_most})"
        for name, bound in bounds.items()
        if bound.least > bound.most and name != "mu_rho"
    ]
    if broken:
        return Design(None, "; ".join(broken), bounds, math.nan, math.nan, _note(task))
    crossover, phase = _crossover(most1, most_rho, task)
    margins = (phase - crossover * task.left_over, phase / crossover)
    notes = _note(task, task.speeds.highest * most_rho / most1)
    return Design((most1, mu2, most_rho), None, bounds, *margins, notes)


def _growth(mu1: float, mu_rho: float, task: Task) -> tuple[float, str]:
    """How far mu1 may grow, and mu_rho with it, and what ends that; below 1 if they are too high already."""
    crossover, phase = _crossover(mu1, mu_rho, task)
    late = (phase - PHASE_MARGIN) / (crossover * task.left_over) if task.left_over > 0.0 else math.inf
    fast = task.limits.v_max / (_SWING * task.rho_0 * mu1)
    soon = _most_mu2(mu1, task)[0] / (_FASTER * mu1)
    left = f"what v_max = {task.limits.v_max:g} m/s leaves"
    ends = {
        max(0.0, late): _why_late(task),
        _quietest(mu1, mu_rho, task): f"{_SIGMAS:g} standard deviations of noise in v2 within {left}",
        fast: f"alpha1 {_SWING:g} rad off has to call for no more than v_max = {task.limits.v_max:g} m/s",
        soon: f"{_FASTER:g} times it is the most that mu2 bears",
    }
    least = min(ends)
    return least, ends[least]


def _quietest(mu1: float, mu_rho: float, task: Task) -> float:
    """Growth at which the noise in v2 takes up what a leader at its fastest leaves of the speed."""
    bearable = ((task.limits.v_max - task.speeds.highest) / _SIGMAS) ** 2 - task.sd_v1**2
    by_angle = (task.rho_0 * mu1 * task.sd_alpha1) ** 2
    by_distance = (2.0 * task.speeds.highest * mu_rho * task.sd_rho) ** 2
    if bearable <= 0.0:
        return 0.0
    # by_angle s^2 + by_distance s^4 = bearable, in the form that bears by_distance = 0.
    bottom = by_angle + math.sqrt(by_angle**2 + 4.0 * by_distance * bearable)
    return math.sqrt(2.0 * bearable / bottom) if bottom > 0.0 else math.inf


def _why_late(task: Task) -> str:
    return f"phase margin of 45 deg with the {1e3 * task.left_over:.0f} ms of delay that prediction leaves"


def _out_of_reach(task: Task) -> str | None:
    v_max, slow, fast = task.limits.v_max, task.speeds.lowest, task.speeds.highest
    if fast >= v_max:
        return f"the leader drives up to {fast:g} m/s, the follower at most {v_max:g}: it would fall behind"
    if task.k_u >= task.limits.u_max:
        return f"the leader turns at up to {task.k_u:g} rad/s, the follower at most {task.limits.u_max:g}"
    needed = slow + task.rho_0 * task.k_u
    if needed > v_max + _HAIR:
        return (
            f"on the leader's tightest circle, {slow / task.k_u:.3g} m, the follower outside needs "
            f"{needed:.3g} m/s at the leader's slowest, and has {v_max:g}: stay nearer than {task.rho_0:g} m"
        )
    return None


def _note(task: Task, pull: float = 0.0) -> str | None:
    """What to know of gains; ``pull``: v mu_rho in mu1."""
    notes: list[str] = []
    held = (task.limits.v_max - task.speeds.highest) / task.rho_0
    if held < task.k_u - _HAIR:
        notes.append(
            f"outside a leader at {task.speeds.highest:g} m/s the follower is fast enough for lasting turns "
            f"of up to {held:.3g} rad/s only; harder ones have to be short"
        )
    if pull > 1.0 + _HAIR:
        notes.append(
            f"start near the formation: v1 mu_rho is {pull:.3g} mu1, so that from afar the pair may go round "
            "at v_max for ever"
        )
    return "; ".join(notes) or None


def _lowest(task: Task) -> tuple[float, float, str] | None:
    """(mu1, mu_rho) of the weakest law that keeps the pair together, and what demands it."""
    outer, inner = 1.0 - (1.0 + task.band) ** -2, (1.0 - task.band) ** -2 - 1.0
    steady = task.k_u / (task.speeds.lowest * min(outer, inner))
    quick = 0.5 * (0.5 / (_PATH * _DAMPINGS[0])) ** 2 * 4.0 / task.rho_0
    start = max(steady, quick)
    for step in range(_STEPS):
        mu_rho = start * _STEP**step
        for damping in _DAMPINGS:
            mu1 = 2.0 * damping * _frequency(mu_rho, task)
            if _holds(mu1, Spacing(task.rho_0, mu_rho), task):
                if step == 0 and quick > steady:
                    return mu1, mu_rho, f"a distance that is off closes in over {_PATH:g} rho_0 of path"
                within = (
                    f"distance within {100.0 * task.band:g} % of rho_0 whatever |u1| <= {task.k_u:g} does"
                )
                return mu1, mu_rho, f"{within}, and k_u* above {STEERING_RESERVE:g} k_u by a constant metric"
    return None


def _holds(mu1: float, spacing: Spacing, task: Task) -> bool:
    found = invariant_set(Disturbed(mu1, spacing, task.speeds, task.k_u))
    if found is None or found.rho_max > (1.0 + task.band) * task.rho_0:
        return False
    return found.rho_min >= (1.0 - task.band) * task.rho_0 and all(
        settles(Disturbed(mu1, spacing, SpeedRange(v, v), STEERING_RESERVE * task.k_u))
        for v in (task.speeds.lowest, task.speeds.highest)
    )


def _frequency(mu_rho: float, task: Task) -> float:
    """Natural frequency [rad/s] of the distance at the leader's highest speed, where damping is least."""
    return task.speeds.highest * math.sqrt(2.0 * mu_rho / task.rho_0)


def _crossover(mu1: float, mu_rho: float, task: Task) -> tuple[float, float]:
    """Crossover [rad/s] and phase [rad] above -pi there, without delay."""
    square = _frequency(mu_rho, task) ** 2
    crossover = math.sqrt(0.5 * (mu1**2 + math.hypot(mu1**2, 2.0 * square)))
    return crossover, math.atan2(mu1 * crossover, square)


def _most_mu2(mu1: float, task: Task) -> tuple[float, str]:
    """The highest mu2 and what ends it; its loop is mu2 / s with the delay."""
    late = PHASE_MARGIN / task.left_over if task.left_over > 0.0 else math.inf
    bearable = (task.limits.u_max - task.k_u) / _SIGMAS - mu1 * task.sd_alpha1
    loud = max(0.0, bearable) / task.sd_alpha2 if task.sd_alpha2 > 0.0 else math.inf
    if late <= loud:
        return late, _why_late(task)
    left = f"what u_max = {task.limits.u_max:g} rad/s leaves"
    return loud, f"{_SIGMAS:g} standard deviations of noise in u2 within {left}"


def _why_mu2(by_error: float, mu1: float, task: Task) -> str:
    if by_error < _FASTER * mu1:
        return f"{_FASTER:g} mu1: alpha2 settles before alpha1 relies on it"
    return f"alpha2 ends within {ALPHA2_WITHIN:g} rad though its rate may be {task.M_alpha2:.3g} rad/s wrong"
