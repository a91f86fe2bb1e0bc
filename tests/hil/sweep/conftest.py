from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from hil.sweep.spec import Sweep, load_sweep

SMALL = """
runs = 3
duration_s = 5.0
estimators = ["ekf", "difference"]
set = ["controller.max_age_s=0.4"]

[grid]
sigma_position = [0.0003, 0.002]
sigma_heading = [0.003490658503988659]
latency_s = [0.05]
loss = [0.1]
"""


@pytest.fixture
def make_sweep(tmp_path: Path) -> Callable[..., Sweep]:
    """Small sweep from its text, with keys overridden."""

    def make(text: str = SMALL, **changes: Any) -> Sweep:
        path = tmp_path / "small.toml"
        path.write_text(text)
        return load_sweep(str(path), **changes)

    return make
