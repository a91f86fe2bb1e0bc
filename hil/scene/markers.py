"""Markers as RViz, Foxglove and Lichtblick draw them: shapes, lines and texts in a frame of reference."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

from rosbags.typesys.stores import ros2_humble as ros

from hil.wire import message_types as msg
from hil.wire.messages import header

Marker = ros.visualization_msgs__msg__Marker
MarkerArray = ros.visualization_msgs__msg__MarkerArray
_Colour = ros.std_msgs__msg__ColorRGBA

Point = tuple[float, float]


class Colour(NamedTuple):
    """Red, green, blue and opacity, each from 0 to 1."""

    r: float
    g: float
    b: float
    a: float = 1.0

    def faint(self, opacity: float) -> Colour:
        """The same, less opaque."""
        return self._replace(a=opacity)


@dataclass(frozen=True, slots=True)
class Brush:
    """Makes the markers of a scene: their frame, time, namespace, and for how long [s] each is shown."""

    frame: str
    stamp_ns: int
    group: str
    lifetime_s: float

    def cylinder(self, number: int, at: Point, height: float, sizes: Point, colour: Colour) -> Marker:
        """An upright cylinder from the floor up; ``sizes``: diameters [m] along x and y."""
        pose = _pose(at, 0.5 * height, _upright(0.0))
        return self._marker(number, Marker.CYLINDER, pose, (*sizes, height), colour)

    def wheel(self, number: int, at: Point, diameter: float, width: float, colour: Colour) -> Marker:
        """A cylinder that lies on its side, its axis along y, on the floor."""
        half = math.sqrt(0.5)
        turned = msg.Quaternion(x=half, y=0.0, z=0.0, w=half)
        pose = _pose(at, 0.5 * diameter, turned)
        return self._marker(number, Marker.CYLINDER, pose, (diameter, diameter, width), colour)

    def arrow(self, number: int, begin: Point, end: Point, z: float, width: float, colour: Colour) -> Marker:
        """An arrow from one point to another."""
        sizes = (width, 2.2 * width, 3.0 * width)
        return self._marker(number, Marker.ARROW, _ORIGIN, sizes, colour, points=_points((begin, end), z))

    def line(self, number: int, points: Iterable[Point], z: float, width: float, colour: Colour) -> Marker:
        """A line along points."""
        return self._marker(
            number, Marker.LINE_STRIP, _ORIGIN, (width, 0.0, 0.0), colour, points=_points(points, z)
        )

    def text(self, number: int, at: Point, z: float, size: float, text: str, colour: Colour) -> Marker:
        """A text that faces who looks; ``size`` [m]: height of its capitals."""
        pose = _pose(at, z, _upright(0.0))
        return self._marker(number, Marker.TEXT_VIEW_FACING, pose, (0.0, 0.0, size), colour, text=text)

    def _marker(
        self,
        number: int,
        kind: int,
        pose: msg.Pose,
        sizes: tuple[float, float, float],
        colour: Colour,
        *,
        points: list[msg.Point] | None = None,
        text: str = "",
    ) -> Marker:
        whole_s, rest = divmod(self.lifetime_s, 1.0)
        return Marker(
            header=header(self.stamp_ns, self.frame),
            ns=self.group,
            id=number,
            type=kind,
            action=Marker.ADD,
            pose=pose,
            scale=msg.Vector3(*sizes),
            color=_Colour(*colour),
            lifetime=ros.builtin_interfaces__msg__Duration(sec=int(whole_s), nanosec=round(rest * 1e9)),
            frame_locked=True,
            points=points or [],
            colors=[],
            texture_resource="",
            texture=_NO_TEXTURE,
            uv_coordinates=[],
            text=text,
            mesh_resource="",
            mesh_file=_NO_MESH,
            mesh_use_embedded_materials=False,
        )


def circle(middle: Point, radius: float, steps: int = 36) -> list[Point]:
    """A closed circle as points."""
    return ellipse(middle, (radius, radius), 0.0, steps)


def ellipse(middle: Point, radii: Point, turn: float, steps: int = 36) -> list[Point]:
    """A closed ellipse as points, its first axis turned [rad] from x."""
    cos, sin = math.cos(turn), math.sin(turn)
    points: list[Point] = []
    for step in range(steps + 1):
        angle = math.tau * step / steps
        along, across = radii[0] * math.cos(angle), radii[1] * math.sin(angle)
        points.append((middle[0] + cos * along - sin * across, middle[1] + sin * along + cos * across))
    return points


def sector(middle: Point, radii: Point, turn: float, half_angle: float, steps: int = 24) -> list[Point]:
    """The outline of a ring's part between two radii, up to an angle [rad] to both sides of a direction."""
    angles = [turn + half_angle * (2.0 * step / steps - 1.0) for step in range(steps + 1)]
    outer = [on_ray(middle, angle, radii[1]) for angle in angles]
    inner = [on_ray(middle, angle, radii[0]) for angle in reversed(angles)]
    return [*outer, *inner, outer[0]]


def on_ray(begin: Point, angle: float, length: float) -> Point:
    """The point at a distance from another in a direction."""
    return begin[0] + length * math.cos(angle), begin[1] + length * math.sin(angle)


def _points(points: Iterable[Point], z: float) -> list[msg.Point]:
    return [msg.Point(x=x, y=y, z=z) for x, y in points]


def _pose(at: Point, z: float, turned: msg.Quaternion) -> msg.Pose:
    return msg.Pose(position=msg.Point(x=at[0], y=at[1], z=z), orientation=turned)


def _upright(theta: float) -> msg.Quaternion:
    return msg.Quaternion(x=0.0, y=0.0, z=math.sin(0.5 * theta), w=math.cos(0.5 * theta))


def _texture() -> ros.sensor_msgs__msg__CompressedImage:
    import numpy as np

    return ros.sensor_msgs__msg__CompressedImage(
        header=header(0, ""), format="", data=np.zeros(0, dtype=np.uint8)
    )


def _mesh() -> ros.visualization_msgs__msg__MeshFile:
    import numpy as np

    return ros.visualization_msgs__msg__MeshFile(filename="", data=np.zeros(0, dtype=np.uint8))


_ORIGIN = _pose((0.0, 0.0), 0.0, _upright(0.0))
_NO_TEXTURE, _NO_MESH = _texture(), _mesh()
