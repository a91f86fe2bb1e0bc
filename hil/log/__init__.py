"""Logs: MCAP files written, read, recovered."""
