"""Scenarios: what an experiment is, read from TOML and checked."""
