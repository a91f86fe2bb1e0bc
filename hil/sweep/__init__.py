"""Monte Carlo over many runs: the compiled closed loop, its judge, and the workers that share the runs."""
