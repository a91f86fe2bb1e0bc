from __future__ import annotations

import numpy as np
import pytest

from hil.emulator.mocap import Stream, draw_block
from hil.sweep.noise_kernels import draw


@pytest.mark.parametrize("seed", [0, 1, 2**53 + 1, 2**63 - 1])
@pytest.mark.parametrize("block", [0, 7])
def test_the_numbers_are_those_of_the_emulator(seed: int, block: int) -> None:
    # 24,576 normals: hundreds off the common path, several of them beyond the last layer.
    wanted_normals, wanted_shares = draw_block(seed, Stream.MOCAP, block, 6)
    normals, shares = np.empty(wanted_normals.size), np.empty(wanted_shares.size)
    draw(seed, Stream.MOCAP, block, normals, shares)
    np.testing.assert_array_equal(normals, wanted_normals.reshape(-1))
    np.testing.assert_array_equal(shares, wanted_shares.reshape(-1))


def test_a_part_of_a_block_gets_its_first_numbers() -> None:
    wanted, _ = draw_block(5, Stream.FOLLOWER_ODOMETRY, 0, 2)
    normals = np.empty(600)
    draw(5, Stream.FOLLOWER_ODOMETRY, 0, normals, np.empty(0))
    np.testing.assert_array_equal(normals, wanted.reshape(-1)[:600])
