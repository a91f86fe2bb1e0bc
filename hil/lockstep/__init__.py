"""Lockstep: all nodes in one process on a simulated clock."""
