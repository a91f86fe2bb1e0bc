"""What recordings tell of a lab: lag, delays, offsets of sensors, and true motion after the fact."""
