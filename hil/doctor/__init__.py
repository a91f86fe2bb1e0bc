"""The check before a flight: what was seen in a lab, what was expected, and what to do about it."""
