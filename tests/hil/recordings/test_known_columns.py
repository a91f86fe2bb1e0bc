from __future__ import annotations

import pytest

from hil.errors import UsageError
from hil.recordings.known_columns import bracketed, known_columns
from hil.recordings.units import factor_of, spelled

POSES = ["leader_x", "leader_y", "follower_x", "follower_y", "follower_theta"]


@pytest.mark.parametrize(
    ("name", "quantity", "unit"),
    [
        ("lx", "leader_x", None),
        ("Leader X [mm]", "leader_x", "mm"),
        ("x1_cm", "leader_x", "cm"),
        ("leader.pose.position.x", "leader_x", None),
        ("leaderPosX", "leader_x", None),
        ("x_leader (m)", "leader_x", "m"),
        ("th1_mocap", "leader_theta", None),
        ("follower_yaw_deg", "follower_theta", "deg"),
        ("fqz", "follower_qz", None),
        ("v", "v2", None),
        ("v2_mm_s", "v2", "mm/s"),
        ("omega [deg/s]", "u2", "deg/s"),
        ("Turn rate (rad/s)", "u2", "rad/s"),
        ("follower_odom_twist_v", "v2", None),
        ("Time (Seconds)", "t", "Seconds"),
        ("timestamp_ns", "t", "ns"),
    ],
)
def test_a_column_is_known_by_its_name(name: str, quantity: str, unit: str | None) -> None:
    turned = [f"follower_q{axis}" for axis in "xyzw"]
    others = [other for other in ["t", *POSES, *turned, "v2", "u2"] if other != quantity]
    columns = known_columns([name, *others], {}).columns
    assert (columns[quantity].column, columns[quantity].unit) == (name, unit)


@pytest.mark.parametrize(
    "name", ["alpha1", "frame", "x", "leader_x_error", "battery_v_max", "lidar_3", "theta", "xl2f"]
)
def test_what_is_not_surely_something_is_nothing(name: str) -> None:
    found = known_columns(["t", *POSES, name], {})
    assert found == known_columns(["t", *POSES], {})


def test_range_and_bearing_measure_where_poses_are_not_complete() -> None:
    found = known_columns(["t", "range", "bearing_deg", "v", "w", "leader_x", "leader_y", "v1"], {})
    assert found.columns.keys() == {"t", "rho", "alpha2", "v2", "u2"}
    assert found.columns["alpha2"].unit == "deg"
    assert found.truth.keys() == {"leader_x", "leader_y", "v1"}


def test_a_line_of_units_counts_for_names_without_one() -> None:
    found = known_columns(["t", *POSES], {"leader_x": "mm", "follower_theta": "deg"})
    assert found.columns["leader_x"].unit == "mm"
    assert found.columns["follower_theta"].unit == "deg"
    assert found.columns["leader_y"].unit is None


def test_half_a_motion_and_half_a_quaternion_are_left_out() -> None:
    found = known_columns(["t", *POSES, "v2", "leader_qx", "leader_qy", "follower_qw"], {})
    assert found == known_columns(["t", *POSES], {})


@pytest.mark.parametrize(
    ("names", "said"),
    [
        (["t", *POSES, "lx"], "columns 'leader_x' and 'lx' could both be leader_x"),
        (["t", "a", "b"], r"not known by their names; give --map FILE.*there are: t, a, b"),
        (["t", *POSES[:-1]], "not known by their names"),
    ],
)
def test_what_is_not_obvious_is_said_in_a_line(names: list[str], said: str) -> None:
    with pytest.raises(UsageError, match=said) as caught:
        known_columns(names, {})
    assert "\n" not in str(caught.value)


def test_two_that_could_be_what_nobody_needs_are_no_mistake() -> None:
    assert "rho" not in known_columns(["t", *POSES, "rho_lidar", "rho_mocap"], {}).columns


@pytest.mark.parametrize(
    ("text", "name", "unit"),
    [("x [mm]", "x", "mm"), ("x(deg)", "x", "deg"), ("x [left]", "x [left]", None), ("x", "x", None)],
)
def test_brackets_hold_units(text: str, name: str, unit: str | None) -> None:
    assert bracketed(text) == (name, unit)


def test_units_are_known_by_their_other_spellings() -> None:
    assert factor_of("leader_x", "Millimeters") == 0.001
    assert factor_of("t", "\N{GREEK SMALL LETTER MU}s") == 1e-6
    assert (
        factor_of("u2", "[\N{DEGREE SIGN}/s]") == factor_of("u2", "deg per s") == pytest.approx(0.0174532925)
    )
    assert factor_of("v2", "km/h") == pytest.approx(1 / 3.6)
    assert factor_of("leader_x", "deg") is None
    assert spelled(" (Radians) ") == "rad"
