"""The proof in intervals that a metric shrinks all distances over a set, and that no motion leaves it.

The system is that of :mod:`formation.contraction_metric`. The set is covered by boxes in y = rho_0 / rho and
theta. On each the matrices are enclosed by their values at its middle plus their derivatives anywhere in it
times the way to its sides; a box on which that is too coarse is cut in four. Every piece of the boundary is
enclosed by a box of its own.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from formation.angles import FloatArray
from formation.contraction_metric import Metric
from formation.error_set_kernels import ErrorModel
from formation.intervals import Interval, Slope, constant, exactly
from formation.invariant_set import InvariantSet
from formation.shape import ABREAST_ALPHA1

_COLUMNS, _ROWS = 48, 32
_MOST_BOXES = 25_000
_BESIDE = 1e-12
"""Of a distance: more than its division rounds."""

BoolArray = NDArray[np.bool_]
Value = TypeVar("Value", Interval, Slope)
Coefficients = list[list[Interval]]


@dataclass(frozen=True, slots=True, eq=False)
class Units:
    """The system in units of rho_0, each constant within an interval."""

    lam: Interval
    mu: Interval
    D: Interval

    @staticmethod
    def of(model: ErrorModel) -> Units:
        """The constants of a model, whose W is not looked at."""
        per_path = exactly(model.rho_0) / exactly(model.v1)
        return Units(
            exactly(model.mu_rho) * exactly(model.rho_0),
            exactly(model.mu1) * per_path,
            exactly(model.k_u) * per_path,
        )


@dataclass(frozen=True, slots=True, eq=False)
class Boxes:
    """Boxes in y and theta: four arrays of one shape (n,)."""

    y_lo: FloatArray
    y_hi: FloatArray
    theta_lo: FloatArray
    theta_hi: FloatArray

    def __len__(self) -> int:
        return len(self.y_lo)

    def __getitem__(self, which: slice | BoolArray) -> Boxes:
        return Boxes(*(getattr(self, name)[which] for name in self.__slots__))

    def quartered(self) -> Boxes:
        """Four boxes for each, which cover it."""
        y, theta = 0.5 * (self.y_lo + self.y_hi), 0.5 * (self.theta_lo + self.theta_hi)
        ys, thetas = ((self.y_lo, y), (y, self.y_hi)), ((self.theta_lo, theta), (theta, self.theta_hi))
        quarters = [(*one, *other) for one in ys for other in thetas]
        return Boxes(*(np.concatenate(sides) for sides in zip(*quarters, strict=True)))


def keeps(model: ErrorModel, inside: InvariantSet) -> bool:
    """Whether no motion of the reduced system (5) under law (8), |u1| <= k_u, W = 0, leaves the set.

    On every piece of the polygon the outward speed is not positive, for the worst steering: zero only on the
    upright ends, along which the field runs where theta = 0.
    """
    (near, far), (also_near, also_far) = ((rhos[0], rhos[-1]) for rhos, _ in (inside.inward, inside.outward))
    if (near, far) != (also_near, also_far):
        return False
    return _keeps_half(model, *inside.inward, 1.0) and _keeps_half(model, *inside.outward, -1.0)


def _keeps_half(model: ErrorModel, rhos: FloatArray, psis: FloatArray, side: float) -> bool:
    """The half on which side theta = psi >= 0; rho grows along the curve."""
    along = np.diff(rhos)
    if np.any(along < 0.0) or np.any(psis < 0.0) or np.any(psis >= 3.14) or psis[0] != 0.0 or psis[-1] != 0.0:
        return False
    v1, mu1 = exactly(model.v1), exactly(model.mu1)
    rho = Interval(rhos[:-1], rhos[1:])
    sine = Interval(np.minimum(psis[:-1], psis[1:]), np.maximum(psis[:-1], psis[1:])).sin()
    sine = Interval(np.maximum(sine.lo, 0.0), sine.hi)
    near = exactly(model.rho_0) / rho
    pull = exactly(model.mu_rho) * (exactly(1.0) - near * near)
    turn = exactly(side) * v1 * pull - mu1 * sine + exactly(model.k_u)
    rises = exactly(-side) * v1 * sine
    step, climb = exactly(rhos[1:]) - exactly(rhos[:-1]), exactly(psis[1:]) - exactly(psis[:-1])
    outward = step * turn - climb * rises
    upright = along == 0.0
    # Upright pieces stand at the ends, where the half's own rho_dot leads away from them into the set.
    leads_in = (rhos[:-1] > 0.5 * (rhos[0] + rhos[-1])) == (side > 0.0)
    return bool(np.all(np.where(upright, leads_in, outward.hi < 0.0)))


def shrinks(model: ErrorModel, metric: Metric, inside: InvariantSet) -> bool:
    """Whether M > 0 and M' + M J + J^T M < 0 over the whole set, for all steering within k_u."""
    units = Units.of(model)
    boxes = cover(model, inside)
    while len(boxes):
        shown, refuted = _shown(units, metric, boxes)
        if len(boxes) > _MOST_BOXES or np.any(refuted & _middle_within(model, inside, boxes)):
            return False
        boxes = clipped(model, inside, boxes[~shown].quartered())
    return True


def cover(model: ErrorModel, inside: InvariantSet) -> Boxes:
    """Boxes that hold the whole set."""
    lowest, highest = (
        model.rho_0 / inside.rho_max * (1.0 - _BESIDE),
        model.rho_0 / inside.rho_min * (1.0 + _BESIDE),
    )
    edges = np.linspace(lowest, highest, _COLUMNS + 1)
    theta = np.linspace(-np.pi, np.pi, _ROWS + 1)
    sides = (edges[:-1], edges[1:], theta[:-1], theta[1:])
    columns, rows = np.meshgrid(np.arange(_COLUMNS), np.arange(_ROWS), indexing="ij")
    places = (columns.ravel(), columns.ravel(), rows.ravel(), rows.ravel())
    return clipped(model, inside, Boxes(*(side[at] for side, at in zip(sides, places, strict=True))))


def clipped(model: ErrorModel, inside: InvariantSet, boxes: Boxes) -> Boxes:
    """What of the boxes can meet the set: cut to the range of theta that it has over their distances."""
    rho_lo = model.rho_0 / boxes.y_hi * (1.0 - _BESIDE)
    rho_hi = model.rho_0 / boxes.y_lo * (1.0 + _BESIDE)
    highest, lowest = _widest(inside.inward, rho_lo, rho_hi), -_widest(inside.outward, rho_lo, rho_hi)
    meets = (boxes.theta_lo <= highest) & (boxes.theta_hi >= lowest)
    cut = Boxes(
        boxes.y_lo, boxes.y_hi, np.maximum(boxes.theta_lo, lowest), np.minimum(boxes.theta_hi, highest)
    )
    return cut[meets]


def _widest(curve: tuple[FloatArray, FloatArray], lo: FloatArray, hi: FloatArray) -> FloatArray:
    """Largest psi of a polygon over distances from lo to hi; an upper bound of it near its corners."""
    rhos, psis = curve
    first = np.maximum(np.searchsorted(rhos, lo, "left") - 1, 0)
    last = np.minimum(np.searchsorted(rhos, hi, "right"), len(rhos) - 1)
    ends = np.minimum(np.stack([first, last + 1], axis=1).ravel(), len(rhos))
    widest: FloatArray = np.maximum.reduceat(np.append(psis, 0.0), ends)[::2]
    return widest


def _middle_within(model: ErrorModel, inside: InvariantSet, boxes: Boxes) -> BoolArray:
    rho = model.rho_0 / (0.5 * (boxes.y_lo + boxes.y_hi))
    return inside.contains(rho, 0.5 * (boxes.theta_lo + boxes.theta_hi) + ABREAST_ALPHA1)


def _shown(units: Units, metric: Metric, boxes: Boxes) -> tuple[BoolArray, BoolArray]:
    """Which boxes pass, and which have a middle that does not, whatever was rounded; shape (n,)."""
    shown, refuted = np.ones(len(boxes), dtype=np.bool_), np.zeros(len(boxes), dtype=np.bool_)
    for (m11, m12, m22), anywhere in enclosed(units, metric, boxes):
        shown &= _positive(*anywhere)
        refuted |= (m11.hi < 0.0) | (m22.hi < 0.0) | ((m11 * m22 - m12 * m12).hi < 0.0)
    return shown, refuted


def enclosed(
    units: Units, metric: Metric, boxes: Boxes
) -> list[tuple[tuple[Interval, ...], tuple[Interval, ...]]]:
    """For each of :func:`matrices` its entries at the middles of boxes, and anywhere in them."""
    zero, one = exactly(0.0), exactly(1.0)
    middle_y = exactly(0.5 * (boxes.y_lo + boxes.y_hi))
    middle_theta = exactly(0.5 * (boxes.theta_lo + boxes.theta_hi))
    y, theta = Interval(boxes.y_lo, boxes.y_hi), Interval(boxes.theta_lo, boxes.theta_hi)
    at_middle = matrices(units, metric, middle_y, middle_theta, lambda value: value)
    over_box = matrices(units, metric, Slope(y, one, zero), Slope(theta, zero, one), constant)
    to_y, to_theta = y - middle_y, theta - middle_theta
    found: list[tuple[tuple[Interval, ...], tuple[Interval, ...]]] = []
    for matrix, slopes in zip(at_middle, over_box, strict=True):
        pairs = zip(matrix, slopes, strict=True)
        found.append((matrix, tuple(here + slope.d1 * to_y + slope.d2 * to_theta for here, slope in pairs)))
    return found


def _positive(m11: Interval, m12: Interval, m22: Interval) -> BoolArray:
    """Whether all matrices with entries in these intervals are positive definite."""
    square = exactly(np.maximum(np.abs(m12.lo), np.abs(m12.hi)))
    positive: BoolArray = (
        (m11.lo > 0.0) & (m22.lo > 0.0) & ((exactly(m11.lo) * exactly(m22.lo) - square * square).lo > 0.0)
    )
    return positive


def matrices(
    units: Units, metric: Metric, y: Value, theta: Value, lift: Callable[[Interval], Value]
) -> tuple[tuple[Value, Value, Value], ...]:
    """What must be positive: M, then -(M' + M J + J^T M) for d = -D and D; entries 11, 12, 22 each.

    Of places y and theta as intervals, or as slopes; ``lift`` makes such a value of a constant.
    """

    def just(value: float) -> Value:
        return lift(exactly(value))

    a = (y - just(metric.y_0)) * just(metric.per_y)
    b = (theta - just(metric.theta_0)) * just(metric.per_theta)

    def polynomial(coefficients: Coefficients) -> Value:
        total = just(0.0)
        for row in reversed(coefficients):
            inner = just(0.0)
            for value in reversed(row):
                inner = inner * b + lift(value)
            total = total * a + inner
        return total

    exact = [_exact(entry) for entry in metric.entries]
    m11, m12, m22 = map(polynomial, exact)
    by_a, by_b = (list(map(polynomial, map(along, exact))) for along in (_along_first, _along_second))
    sine, cosine, nothing, two = theta.sin(), theta.cos(), just(0.0), just(2.0)
    squared = y * y
    j12, j22 = nothing - just(metric.w) * cosine, nothing - lift(units.mu) * cosine
    j21 = lift((units.lam + units.lam) / exactly(metric.w)) * squared * y
    moves_a = squared * sine * just(metric.per_y)
    turns = lift(units.lam) * (just(1.0) - squared) - lift(units.mu) * sine
    still = (
        two * j21 * m12 + moves_a * by_a[0],
        j12 * m11 + j22 * m12 + j21 * m22 + moves_a * by_a[1],
        two * (j12 * m12 + j22 * m22) + moves_a * by_a[2],
    )
    found = [(m11, m12, m22)]
    for d in (-units.D, units.D):
        moves_b = (turns + lift(d)) * just(metric.per_theta)
        q11, q12, q22 = (nothing - rest - moves_b * by for rest, by in zip(still, by_b, strict=True))
        found.append((q11, q12, q22))
    return tuple(found)


def _exact(entry: FloatArray) -> Coefficients:
    return [[exactly(value) for value in row[: len(row) - i]] for i, row in enumerate(entry)]


def _along_first(exact: Coefficients) -> Coefficients:
    """Coefficients of the derivative by a."""
    return [[exactly(float(i)) * value for value in exact[i]] for i in range(1, len(exact))]


def _along_second(exact: Coefficients) -> Coefficients:
    """Coefficients of the derivative by b."""
    return [[exactly(float(j)) * row[j] for j in range(1, len(row))] for row in exact[:-1]]
