"""Stands in for the ROS package of mocap4ros2."""
