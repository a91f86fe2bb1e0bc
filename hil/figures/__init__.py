"""Pictures of runs and of noise-free experiments."""
