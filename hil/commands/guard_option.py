"""What commands say of guards that are not there."""

NO_GUARD = "Without guards on the robots: what they are wanted to drive goes to their drivers."
