"""Feedback laws of the follower, its limits and the guard that stops it."""
