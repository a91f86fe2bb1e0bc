from __future__ import annotations

import csv
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hil.errors import UsageError
from hil.replay.estimate_csv import write_estimates
from hil.wire.message_types import LeaderEstimate, Message
from hil.wire.messages import header


@pytest.fixture
def estimate(sample_messages: dict[str, Message]) -> LeaderEstimate:
    found = sample_messages["follower/leader_estimate"]
    assert isinstance(found, LeaderEstimate)
    return found


def test_a_row_has_the_estimate_to_the_last_digit(estimate: LeaderEstimate, tmp_path: Path) -> None:
    exact = replace(
        estimate,
        header=header(1_700_000_000_000_000_007, ""),
        rho=0.1 + 0.2,
        covariance=np.diag([0.01, 0.04, 0.09, 0.16, 0.25]).reshape(25),
        bound_alpha1=math.pi,
        bound_v1=math.nan,
    )
    write_estimates([exact, estimate], tmp_path / "e.csv")
    with (tmp_path / "e.csv").open(newline="") as stream:
        first, second = csv.DictReader(stream)
    wanted = "t rho alpha2 rho_dot alpha2_dot v1 alpha1 u1 sd_rho_dot sd_alpha2_dot sd_v1 sd_alpha1 sd_u1"
    assert list(first) == [*wanted.split(), "bound_v1", "bound_alpha1", "status"]
    assert first["t"] == "1700000000.000000007"
    assert float(first["rho"]) == 0.1 + 0.2
    sds = [float(first[f"sd_{name}"]) for name in ("rho_dot", "alpha2_dot", "v1", "alpha1", "u1")]
    assert sds == [0.1, 0.2, 0.3, 0.4, 0.5]
    assert float(first["bound_alpha1"]) == math.pi
    assert first["bound_v1"] == ""
    assert first["status"] == "tracking"
    assert float(second["u1"]) == estimate.u1


def test_a_file_that_cannot_be_written_is_said_so(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="cannot be written"):
        write_estimates([], tmp_path / "none" / "e.csv")
