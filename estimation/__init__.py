"""Estimation of the leader's motion from its position, and the error bounds it is judged by."""
