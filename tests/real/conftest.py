"""Real peers for the tests here: they need what `scripts/setup peers` puts into .venv-peers."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.real.ros_lab import peers_python


@pytest.fixture(scope="session")
def peers() -> Path:
    """Python that has ROS 2 and the clients of others."""
    python = peers_python()
    if python is None:
        pytest.skip("no real peers here; run scripts/setup peers, or name their venv with ABREAST_PEERS")
    return python
