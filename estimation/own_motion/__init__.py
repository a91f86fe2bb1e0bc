"""The follower's own motion: from odometry, from its mocap track, and each matched to the other."""
