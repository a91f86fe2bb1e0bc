"""Where the robots of a scenario stand before anything moves."""

from __future__ import annotations

from formation.pose import Pose
from formation.shape import Shape, follower_pose, shape_of
from hil.errors import UsageError
from hil.scenario.schema import Scenario


def start_poses(scenario: Scenario) -> tuple[Pose, Pose]:
    """Start poses of leader and follower in the world frame."""
    leader, follower = Pose(*scenario.leader.pose), Pose(*scenario.follower.pose)
    if (leader.x, leader.y) == (follower.x, follower.y):
        raise UsageError(
            f"scenario {scenario.name}: leader.pose and follower.pose are both at ({leader.x}, {leader.y}); "
            "set them apart"
        )
    return leader, follower


def start_shape(scenario: Scenario) -> Shape:
    """Shape of the pair at the start."""
    return shape_of(*start_poses(scenario))


def chain_poses(scenario: Scenario, agents: int) -> tuple[Pose, ...]:
    """Start poses of a chain of agents: from the third on each in the same shape to the one before it."""
    poses, shape = list(start_poses(scenario)), start_shape(scenario)
    while len(poses) < agents:
        poses.append(follower_pose(shape, poses[-1]))
    return tuple(poses)
