"""Geometry and plant of two planar robots: poses, shape variables, spacing functions, leader programs."""
