"""What diagnostics show of the leader's driving as it was found."""

from __future__ import annotations

from estimation.consistency.process_estimate import LearnedProcess, ProcessLearning, learned_noise


def process_report(found: LearnedProcess, learning: ProcessLearning) -> dict[str, object]:
    """Bandwidths [1/s] by the names of diagnostics; nothing where they are given."""
    if not learning.on:
        return {}
    noise = learned_noise(found, learning)
    return {
        "process.turn_bandwidth": f"{noise.q_u / learning.turn:.3g}",
        "process.speed_bandwidth": f"{noise.q_v / learning.speed:.3g}",
    }
