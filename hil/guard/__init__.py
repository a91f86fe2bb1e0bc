"""The guard on a robot, between the wire and its driver; it runs where only Zenoh is installed."""
