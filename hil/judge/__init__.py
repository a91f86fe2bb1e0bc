"""From a log to its figures: errors, bounds, formation, latency."""
