from __future__ import annotations

import pytest

from hil.reports.notation import written


@pytest.mark.parametrize(
    ("plain", "in_signs"),
    [
        ("rho 0.2 to 0.3 m, rho_dot, alpha2_dot", "ρ 0.2 to 0.3 m, ρ̇, α̇₂"),
        ("between 1.0000 and 1.5 rad/s", "between 57.3 and 85.9 deg/s"),
        ("M_alpha2 = 2.0e-1 rad/s >= mu2", "M_α₂ = 11.5 deg/s ≥ μ₂"),
        ("at most 0.07 m/s^2", "at most 0.07 m/s²"),
        ("2.0e-05 rho_0 or rad a second", "2.0e-05 ρ₀ or rad a second"),
        ("set estimator.sigma_position, controller.mu2", "set estimator.sigma_position, controller.mu2"),
        ("law my_law.py:rho failed", "law my_law.py:rho failed"),
        ("/tmp/v1/run.mcap", "/tmp/v1/run.mcap"),
        ("radians, grad, 5 rads", "radians, grad, 5 rads"),
    ],
)
def test_symbols_and_angles_are_written_in_one_way(plain: str, in_signs: str) -> None:
    assert written(plain) == in_signs
