"""How large a TurtleBot3 Burger is: 0.138 m long, 0.178 m over its wheels, 0.192 m high."""

BODY_DIAMETER = 0.138
WIDTH = 0.178
HEIGHT = 0.192
WHEEL_DIAMETER = 0.066
WHEEL_WIDTH = 0.020
WHEEL_OFFSET = 0.5 * (WIDTH - WHEEL_WIDTH)
"""From the middle of the axis to the middle of each wheel [m]."""
