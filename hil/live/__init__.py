"""Daemons as processes over Zenoh, their supervisor and the recorder."""
