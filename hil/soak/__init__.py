"""Long runs: whether memory stays flat, cycles on time, and the log repeats."""
