"""Faults put into live runs on purpose, and a judge outside who sees what the robots do then."""
