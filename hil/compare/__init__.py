"""Runs, logs and sweeps beside each other: what differs, by how much, and which was better."""
