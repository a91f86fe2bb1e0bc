"""Logs as tables, and for the viewers of others."""
