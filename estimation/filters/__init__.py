"""Estimators of the leader's motion, each behind one protocol, and the table of their names."""
