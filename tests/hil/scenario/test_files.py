from __future__ import annotations

import contextlib
import math
import re
import tomllib
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hil.errors import UsageError
from hil.scenario.files import (
    build_scenario,
    load_scenario,
    merged_scenario,
    scenario_names,
    scenario_text,
    with_overrides,
)
from hil.scenario.schema import ConstantProgram, Scenario

TABLE = "leader.program={kind='table', t=[0.0, 1.0], v=[0.1, 'fast'], u=[0, 0]}"
DROPOUT = re.escape("""--set 'mocap.faults=[{kind="dropout", at_s=18, duration_s=1}]'""")
SLIP = re.escape("""--set 'robot.odometry_faults=[{kind="slip", at_s=18, duration_s=5}]'""")


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("controller.lw=1", r"\[controller\] has an unknown key 'lw'; did you mean 'law'\?"),
        ("mocap.laten_s=0.1", r"\[mocap\] has an unknown key 'laten_s'; did you mean 'latency_s'\?"),
        ("leader.program.omga=1", r"\[leader\.program\] has an unknown key 'omga'; did you mean 'omega'\?"),
        ("robots.lag_s=1", r"unknown key 'robots'; did you mean 'robot'\?"),
        ("mocap.rate_hz=fast", r"mocap\.rate_hz is 'fast': expected float, got str"),
        ("mocap.rate_hz=-120", r"mocap\.rate_hz is -120: expected float >= 0\.01"),
        ("mocap.rate_hz=1e300", r"mocap\.rate_hz is 1e\+300: expected float <= 10000"),
        (
            'leader.program={kind = "constant", v = -0.1}',
            r"leader\.program\.v is -0\.1: expected float >= 0\.0",
        ),
        ("formation.rho_0=0", r"formation\.rho_0 is 0: expected float >= 0\.001"),
        ("formation.rho_0=nan", r"formation\.rho_0 is nan, expected a finite number"),
        ("leader.pose=[0.0, inf, 0.0]", r"leader\.pose is inf, expected a finite number"),
        ("leader.pose=[0.0, 1.0]", r"leader\.pose is \[0\.0, 1\.0\]: expected array of length 3, got 2"),
        ("mocap.loss=1.0", r"mocap\.loss is 1\.0: expected float < 1\.0"),
        ("run.seed=1.5", r"run\.seed is 1\.5: expected int, got float"),
        ("leader.name='two words'", r"leader\.name is 'two words': expected str matching"),
        ("controller.law=best", r"controller\.law is 'best': expected one of 'independent', 'ideal'"),
        ("estimator.kind=kalman", r"estimator\.kind is 'kalman': expected one of 'ekf', 'ukf', "),
        ("leader.program.kind=spiral", r"kind is 'spiral': expected one of 'constant', .*'table'"),
        ("mocap=3", r"mocap is 3: expected a section, got int"),
        (TABLE, r"leader\.program\.v\[1\] is 'fast': expected float, got str"),
        ("mocap.loss", r"--set 'mocap\.loss': expected section\.key=value"),
        ("=0.1", r"--set '=0\.1': expected section\.key=value"),
        ("mocap..loss=0.1", r"expected section\.key=value"),
        ("leader.pose.x=1", r"'pose' is a value and has no keys below it"),
        (
            "mocap.faults=dropout",
            rf"mocap\.faults is 'dropout': expected a list of tables, .* as in {DROPOUT}",
        ),
        ("mocap.faults.kind=dropout", rf"mocap\.faults: expected a list of tables, .* as in {DROPOUT}"),
        ("mocap.faults=['dropout']", rf"faults\[0\] is 'dropout': expected a section, .* as in {DROPOUT}"),
        ("mocap.faults=[{kind='freeze'}]", r"faults\[0\]: missing required field at_s; as in --set 'mocap"),
        ("mocap.dropout=2", rf"key 'dropout'; 'dropout' is a kind of mocap\.faults: give {DROPOUT}"),
        ("mocap.dropouts=2", rf"key 'dropouts'; 'dropout' is a kind of mocap\.faults: give {DROPOUT}"),
        ("robot.slip=1", rf"'slip' is a kind of robot\.odometry_faults: give {SLIP}"),
        (
            "robot.odometry_faults=3",
            r"robot\.odometry_faults is 3: expected a list of tables, got int; as in",
        ),
        ("a." * 4000 + "b=1", r"nested too deeply"),
    ],
)
def test_a_mistake_is_answered_by_one_line_that_helps(override: str, message: str) -> None:
    with pytest.raises(UsageError, match=message) as caught:
        load_scenario("turtlebot3", [override])
    assert "\n" not in str(caught.value)
    assert caught.value.exit_code == 2


@pytest.mark.parametrize(
    "override", [re.sub(r"\\(.)", r"\1", each).removeprefix("--set ").strip("'") for each in (DROPOUT, SLIP)]
)
def test_the_examples_in_messages_are_accepted(override: str) -> None:
    scenario = load_scenario("turtlebot3", [override])
    moments = [each.at_s for each in scenario.mocap.faults]
    assert [*moments, *(each.at_s for each in scenario.robot.odometry_faults)] == [18.0]


def test_a_missing_key_is_named() -> None:
    with pytest.raises(UsageError, match="leader: missing required field k_u"):
        build_scenario(
            {
                "formation": {"rho_0": 0.2},
                "controller": {"mu1": 1.0, "mu2": 1.0, "mu_rho": 1.0},
                "leader": {"pose": [0, 0, 0], "program": {"kind": "constant", "v": 0.1}, "k_v": 0.1},
                "follower": {"pose": [1, 0, 0]},
            }
        )


@pytest.mark.parametrize(
    ("name", "hint"),
    [
        ("turtlebot", "did you mean 'turtlebot3'"),
        ("nothing-like-it", "one of: .*turtlebot3"),
        ("x" * 5000, "no such"),
        ("a\0b", "no such"),
    ],
)
def test_an_unknown_name_is_answered_by_those_that_there_are(name: str, hint: str) -> None:
    with pytest.raises(UsageError, match=hint):
        load_scenario(name)


@pytest.mark.parametrize("content", [b"[run", b"\xff\xfe", b"x = " + b"[" * 5000, b"x = " + b"9" * 5000])
def test_a_file_that_is_no_toml_is_named(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "mine.toml"
    path.write_bytes(content)
    with pytest.raises(UsageError, match=r"mine\.toml: not readable as TOML"):
        load_scenario(str(path))


@pytest.mark.parametrize("name", scenario_names())
def test_text_of_a_scenario_reads_back_as_the_same(name: str, tmp_path: Path) -> None:
    scenario = load_scenario(name)
    path = tmp_path / "copy.toml"
    path.write_text(scenario_text(scenario), encoding="utf-8")
    assert load_scenario(str(path)) == scenario


def test_a_file_of_the_users_own_is_called_after_itself(tmp_path: Path) -> None:
    tree = tomllib.loads(scenario_text(load_scenario("turtlebot3")))
    del tree["name"]
    path = tmp_path / "my-lab.toml"
    path.write_text(scenario_text(build_scenario({**tree, "name": ""})).replace('name = ""\n', "", 1))
    assert load_scenario(str(path)).name == "my-lab"


def test_overrides_are_applied_in_order_and_only_where_they_say() -> None:
    base = load_scenario("turtlebot3")
    changed = with_overrides(base, ["mocap.loss=0.1", "mocap.loss = 0.2", "estimator.kind=ukf"])
    assert (changed.mocap.loss, changed.estimator.kind) == (0.2, "ukf")
    assert with_overrides(changed, ["mocap.loss=0", "estimator.kind='ekf'"]) == base


def test_a_scenario_over_a_base_takes_the_rest_from_it() -> None:
    part = {
        "base": "turtlebot3",
        "mocap": {"loss": 0.1},
        "leader": {"program": {"kind": "constant", "v": 0.05}},
    }
    merged = merged_scenario(part, "mine", "map mine")
    base = load_scenario("turtlebot3")
    assert (merged.name, merged.mocap.loss, merged.mocap.latency_s) == ("mine", 0.1, base.mocap.latency_s)
    assert merged.leader.pose == base.leader.pose
    with pytest.raises(UsageError, match="map mine: base is 3"):
        merged_scenario({"base": 3}, "mine", "map mine")


SECTIONS = {name: list(getattr(load_scenario("turtlebot3"), name).__struct_fields__) for name in (
    "run", "formation", "controller", "leader", "follower", "robot", "mocap", "estimator"
)}  # fmt: skip
keys = st.one_of(
    st.sampled_from([f"{section}.{key}" for section, names in SECTIONS.items() for key in names]),
    st.text(max_size=12),
)
values = st.one_of(
    st.floats().map(str),
    st.integers(-(10**20), 10**20).map(str),
    st.sampled_from(["true", "[]", "{}", "'x'", "1979-05-27", "[1, 2, 3]", "{kind='constant'}", ""]),
    st.text(max_size=12),
)


@given(st.lists(st.builds("{}={}".format, keys, values), max_size=4))
@settings(deadline=None, max_examples=200)
def test_whatever_is_set_gives_a_sound_scenario_or_a_usage_error(overrides: list[str]) -> None:
    with contextlib.suppress(UsageError):
        scenario = load_scenario("turtlebot3", overrides)
        assert isinstance(scenario, Scenario)
        assert all(map(math.isfinite, scenario.leader.pose))
        assert scenario.formation.rho_0 > 0.0


def test_a_file_with_a_base_says_what_differs(tmp_path: Path) -> None:
    (tmp_path / "lab.toml").write_text('base = "turtlebot3"\n[leader]\nbody = 1\n[robot]\nlag_s = 0.2\n')
    (tmp_path / "today.toml").write_text('base = "lab.toml"\n[leader.program]\nkind = "constant"\nv = 0.1\n')
    lab, today = load_scenario(str(tmp_path / "lab.toml")), load_scenario(str(tmp_path / "today.toml"))
    shipped = load_scenario("turtlebot3")
    assert (lab.name, lab.leader.body, lab.robot.lag_s) == ("lab", 1, 0.2)
    assert (lab.controller, lab.leader.program) == (shipped.controller, shipped.leader.program)
    assert (today.name, today.leader.body) == ("today", 1)
    assert today.leader.program == ConstantProgram(v=0.1)
    (tmp_path / "resolved.toml").write_text(scenario_text(today))
    assert load_scenario(str(tmp_path / "resolved.toml")) == today


@pytest.mark.parametrize(
    ("base", "said"),
    [
        ("3", "expected the name of a scenario"),
        ('"lab.toml"', "leads back to itself"),
        ('"nix"', "no such name"),
    ],
)
def test_a_base_that_cannot_be_is_refused(tmp_path: Path, base: str, said: str) -> None:
    path = tmp_path / "lab.toml"
    path.write_text(f"base = {base}\n")
    with pytest.raises(UsageError, match=said):
        load_scenario(str(path))
