from __future__ import annotations

from pathlib import Path

import pytest

from hil.errors import UsageError
from hil.recordings.column_map import Source, load_column_map
from hil.scenario.checked_toml import shipped_names

BODY = """
[columns]
t = "t"
rho = "range"
alpha2 = "bearing"
v2 = { constant = 0.1 }
u2 = { column = "gyro", scale = 0.017, offset = -0.1 }
"""
POSES = """
[columns]
t = "t"
leader_x = "lx"
leader_y = "ly"
follower_x = "fx"
follower_y = "fy"
follower_theta = "ft"
"""
SCENARIO = '[scenario.estimator]\nfront_end = "body"\n'


def written(folder: Path, text: str) -> str:
    (folder / "lab.toml").write_text(text)
    return str(folder / "lab.toml")


def test_an_entry_is_a_column_a_scaled_column_or_a_constant(tmp_path: Path) -> None:
    chart = load_column_map(written(tmp_path, BODY + SCENARIO))
    assert chart.columns == {
        "t": Source(column="t"),
        "rho": Source(column="range"),
        "alpha2": Source(column="bearing"),
        "v2": Source(constant=0.1),
        "u2": Source(column="gyro", scale=0.017, offset=-0.1),
    }
    assert chart.truth == {}
    assert chart.scenario.name == "lab"
    assert chart.sighted
    assert not chart.commanded


def test_poses_alone_tell_the_followers_motion(tmp_path: Path) -> None:
    chart = load_column_map(written(tmp_path, POSES))
    assert not chart.moved
    assert chart.scenario.estimator.own_motion == "auto"


def test_a_map_may_leave_columns_to_their_names(tmp_path: Path) -> None:
    chart = load_column_map(written(tmp_path, "[scenario.leader]\nk_v = 0.7\n"), ["leader.k_u=2.0"])
    assert chart.columns == {}
    assert (chart.scenario.leader.k_v, chart.scenario.leader.k_u) == (0.7, 2.0)


def test_a_unit_stands_for_its_scale_and_a_scale_for_itself() -> None:
    assert Source(column="x", unit="mm").factor("leader_x") == 0.001
    assert Source(column="x").factor("leader_x", "cm") == 0.01
    assert Source(column="x", unit="mm").factor("leader_x", "cm") == 0.001
    assert Source(column="x", scale=2.0).factor("leader_x", "cm") == 2.0
    assert Source(column="x").factor("leader_x") == 1.0


def test_every_shipped_map_is_one_and_is_found_by_its_name() -> None:
    names = shipped_names("maps")
    assert "turtlebot3_lidar_optitrack" in names
    for name in names:
        assert load_column_map(name).scenario.name == name


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            BODY.replace("rho", "rhoo") + SCENARIO,
            r"\[columns\] has an unknown key 'rhoo'; did you mean 'rho'",
        ),
        (BODY.replace('t = "t"\n', "") + SCENARIO, r"columns: missing required field t"),
        (BODY.replace("offset", "ofset") + SCENARIO, r"unknown key 'ofset'; did you mean 'offset'"),
        (
            BODY.replace("constant = 0.1", "scale = 2.0") + SCENARIO,
            r"columns\.v2: give either a column or a con",
        ),
        (
            BODY.replace("constant = 0.1", 'constant = 1.0, column = "v"') + SCENARIO,
            r"columns\.v2: give either",
        ),
        (BODY.replace('rho = "range"\n', "") + SCENARIO, r"columns: rho missing"),
        (BODY.replace('rho = "range"\nalpha2 = "bearing"\n', "") + SCENARIO, r"no measurement; give rho and"),
        (
            BODY + 'leader_x = "x"\n' + SCENARIO,
            r"either rho and alpha2 or the poses; true poses go to \[truth\]",
        ),
        (
            BODY.replace("rho", "leader_x").replace("alpha2", "leader_y"),
            r"follower_theta, follower_x, follower_y",
        ),
        (BODY.replace("v2 = { constant = 0.1 }\n", "") + SCENARIO, r"columns: v2 missing; name a column"),
        (BODY[: BODY.index("v2")] + SCENARIO, r"columns: u2, v2 missing; name columns"),
        (POSES + '[scenario.estimator]\nown_motion = "fused"\n', r"columns: u2, v2 missing; name columns"),
        (POSES + 'leader_qx = "qx"\n', r"columns: leader_qw, leader_qy, leader_qz missing"),
        (
            POSES.replace("follower_theta", "follower_qx"),
            r"columns: follower_qw, follower_qy, follower_qz missing",
        ),
        ('up = "y"\n' + POSES, r"columns: follower_qw, follower_qx, .*follower_z, leader_z missing"),
        (
            POSES.replace('"lx"', '{ column = "lx", unit = "deg" }'),
            r"columns\.leader_x: unit is 'deg', expected one of m, mm, cm",
        ),
        (
            POSES.replace('"lx"', '{ column = "lx", unit = "mm", scale = 2.0 }'),
            r"columns\.leader_x: give either a unit or a scale",
        ),
        ("[topics]", r"map lab: maps the topics of a log; take it to: abreast replay"),
        (BODY, r"range and bearing need the body front end; set scenario\.estimator\.front_end = 'body'"),
        ('inputs = "guessed"\n' + BODY + SCENARIO, r"inputs is 'guessed'"),
        ('delimiter = "tab"\n' + BODY + SCENARIO, r"delimiter is 'tab', expected one character"),
        (BODY + SCENARIO + "lossy = 1\n", r"scenario: \[estimator\] has an unknown key 'lossy'"),
    ],
)
def test_a_mistake_in_a_map_is_one_line_that_helps(text: str, said: str, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=said) as caught:
        load_column_map(written(tmp_path, text))
    assert "\n" not in str(caught.value)


def test_a_misspelt_name_of_a_shipped_map_is_told_the_nearest() -> None:
    with pytest.raises(UsageError, match="did you mean 'turtlebot3_lidar_optitrack'"):
        load_column_map("turtlebot3_lidar_optitrak")
