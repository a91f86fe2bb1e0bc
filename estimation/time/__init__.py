"""Clocks: the mocap's against the host's."""
