"""What moves and what is measured: the leader's motion, its disturbance, and the sensors."""
