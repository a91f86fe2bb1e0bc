from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from formation.contraction_metric import Metric, PathUnits, find_metric
from formation.contraction_proof import Boxes, Units, clipped, cover, enclosed, keeps, matrices, shrinks
from formation.error_set import error_set
from formation.error_set_kernels import ErrorModel
from formation.intervals import exactly
from formation.invariant_set import InvariantSet
from formation.shape import ABREAST_ALPHA1

MODEL = ErrorModel(1.5, 0.2, 20.0, 0.08, 1.15, 0.0)


def held(model: ErrorModel) -> InvariantSet:
    found = error_set(model)
    assert found is not None
    return found.inside


def metric_of(model: ErrorModel, inside: InvariantSet) -> Metric:
    per_path = model.rho_0 / model.v1
    found = find_metric(
        PathUnits(model.mu_rho * model.rho_0, model.mu1 * per_path, model.k_u * per_path), inside, model.rho_0
    )
    assert found is not None
    return found


@pytest.fixture(scope="module")
def inside() -> InvariantSet:
    return held(MODEL)


@pytest.fixture(scope="module")
def metric(inside: InvariantSet) -> Metric:
    return metric_of(MODEL, inside)


def with_inward(inside: InvariantSet, rhos: np.ndarray, psis: np.ndarray) -> InvariantSet:
    return replace(inside, inward=(rhos, psis))


def with_outward(inside: InvariantSet, rhos: np.ndarray, psis: np.ndarray) -> InvariantSet:
    return replace(inside, outward=(rhos, psis))


def places(inside: InvariantSet, n: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """rho and theta drawn in a set, its edge included."""
    random = np.random.default_rng(seed)
    rho = random.uniform(inside.rho_min, inside.rho_max, n)
    low, high = inside.span(rho)
    share = np.clip(random.uniform(-0.1, 1.1, n), 0.0, 1.0)
    return rho, low + share * (high - low) - ABREAST_ALPHA1


def test_the_robot_experiment_at_1_15_is_proved(inside: InvariantSet, metric: Metric) -> None:
    assert keeps(MODEL, inside)
    assert shrinks(MODEL, metric, inside)


def test_more_steering_than_a_set_is_made_for_is_refused(inside: InvariantSet, metric: Metric) -> None:
    """The boundary is disturbed by 6e-4 rad/s too much, no more."""
    harder = MODEL._replace(k_u=1.152)
    assert not keeps(harder, inside)
    assert not shrinks(MODEL._replace(k_u=1.4), metric, inside)
    assert not shrinks(MODEL._replace(mu1=1.2), metric, inside)
    assert not shrinks(MODEL._replace(mu_rho=26.0), metric, inside)
    assert not shrinks(MODEL._replace(v1=0.1), metric, inside)


def test_a_boundary_that_is_drawn_in_is_refused(inside: InvariantSet) -> None:
    for (rhos, psis), put in ((inside.inward, with_inward), (inside.outward, with_outward)):
        assert keeps(MODEL, put(inside, rhos, psis))
        assert not keeps(MODEL, put(inside, rhos, psis * (1.0 - 1e-3)))
        assert not keeps(MODEL, put(inside, rhos[1:], psis[1:])), "it does not begin on the line"
        squeezed = inside.rho_min + (rhos - inside.rho_min) * (1.0 - 1e-9)
        assert not keeps(MODEL, put(inside, squeezed, psis)), "the halves do not meet"
        backwards = np.concatenate([rhos[:5], rhos[4:0:-1], rhos[1:]])
        turned = np.concatenate([psis[:5], psis[4:0:-1], psis[1:]])
        assert not keeps(MODEL, put(inside, backwards, turned))


def test_a_set_without_upright_ends_on_the_right_side_is_refused(inside: InvariantSet) -> None:
    """An upright piece at the end from which the half's motion comes would let it out."""
    rhos, psis = inside.inward
    upright = np.insert(rhos, 1, rhos[0]), np.insert(psis, 1, 1e-3)
    assert not keeps(MODEL, with_inward(inside, *upright))


def test_a_metric_that_is_not_one_is_refused(inside: InvariantSet, metric: Metric) -> None:
    assert not shrinks(MODEL, replace(metric, entries=-metric.entries), inside)
    flat = np.zeros_like(metric.entries)
    flat[0, 0, 0] = flat[2, 0, 0] = 1.0
    assert not shrinks(MODEL, replace(metric, entries=flat), inside)
    mild = MODEL._replace(k_u=0.7)
    assert not shrinks(MODEL, metric_of(mild, held(mild)), inside)


def test_the_matrices_are_those_of_the_text(inside: InvariantSet, metric: Metric) -> None:
    """Against M' by differences along the field, and J by differences of the field."""
    rho, theta = places(inside, 40, 1)
    y, lam, mu = 0.2 / rho, 20.0 * 0.2, 1.5 * 0.2 / 0.08
    thin = matrices(Units.of(MODEL), metric, exactly(y), exactly(theta), lambda value: value)

    def metric_at(x: np.ndarray) -> np.ndarray:
        a, b = (0.2 / x[0] - metric.y_0) * metric.per_y, (x[1] - metric.theta_0) * metric.per_theta
        entries = [np.polynomial.polynomial.polyval2d(a, b, entry) for entry in metric.entries]
        return np.array([[entries[0], entries[1]], [entries[1], entries[2]]])

    for n in range(len(rho)):
        at = np.array([rho[n], theta[n]])
        for which, d in ((1, -1.15 * 0.2 / 0.08), (2, 1.15 * 0.2 / 0.08)):

            def field(x: np.ndarray, d: float = d) -> np.ndarray:
                turn = lam * (1.0 - (0.2 / x[0]) ** 2) - mu * math.sin(x[1]) + d
                return np.array([-0.2 * math.sin(x[1]), turn])

            h, scale = 1e-6, np.diag([metric.w / 0.2, 1.0])
            J = np.column_stack([(field(at + h * e) - field(at - h * e)) / (2.0 * h) for e in np.eye(2)])
            J = scale @ J @ np.linalg.inv(scale)
            moved = (metric_at(at + h * field(at)) - metric_at(at - h * field(at))) / (2.0 * h)
            M = metric_at(at)
            wanted = -(moved + M @ J + J.T @ M)
            for entry, value in zip(thin[which], (wanted[0, 0], wanted[0, 1], wanted[1, 1]), strict=True):
                assert entry.lo[n] - 1e-6 <= value <= entry.hi[n] + 1e-6
                assert entry.hi[n] - entry.lo[n] < 1e-10
        for entry, value in zip(thin[0], metric_at(at)[[0, 0, 1], [0, 1, 1]], strict=True):
            assert entry.lo[n] - 1e-10 <= value <= entry.hi[n] + 1e-10


@pytest.mark.parametrize(("wide_y", "wide_theta"), [(1e-4, 0.02), (0.02, 1e-4), (0.01, 0.01)])
def test_all_values_in_a_box_lie_within_what_encloses_them(
    inside: InvariantSet, metric: Metric, wide_y: float, wide_theta: float
) -> None:
    rho, theta = places(inside, 200, 6)
    y, units, random = 0.2 / rho, Units.of(MODEL), np.random.default_rng(7)
    boxes = Boxes(y - wide_y, y + wide_y, theta - wide_theta, theta + wide_theta)
    for _ in range(20):
        share = np.clip(random.uniform(-1.5, 1.5, (2, len(y))), -1.0, 1.0)
        at = exactly(y + share[0] * wide_y), exactly(theta + share[1] * wide_theta)
        thin = matrices(units, metric, *at, lambda value: value)
        for (_, anywhere), matrix in zip(enclosed(units, metric, boxes), thin, strict=True):
            for wide, value in zip(anywhere, matrix, strict=True):
                assert np.all((wide.lo <= value.hi) & (value.lo <= wide.hi))


def has(boxes: Boxes, y: float, theta: float) -> bool:
    inside = (boxes.y_lo <= y) & (y <= boxes.y_hi) & (boxes.theta_lo <= theta) & (theta <= boxes.theta_hi)
    return bool(inside.any())


def test_every_place_of_the_set_lies_in_a_box(inside: InvariantSet) -> None:
    boxes = cover(MODEL, inside)
    finer = clipped(MODEL, inside, boxes.quartered())
    assert len(boxes) < len(finer) < 4 * len(boxes)
    corners = np.concatenate([inside.inward[0][::200], inside.outward[0][::200]])
    edges = np.concatenate([inside.inward[1][::200], -inside.outward[1][::200]])
    rho, theta = places(inside, 500, 2)
    for near, angle in zip(np.append(rho, corners), np.append(theta, edges), strict=True):
        assert has(boxes, 0.2 / near, angle)
        assert has(finer, 0.2 / near, angle)
