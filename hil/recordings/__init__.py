"""Other recordings turned into logs."""
