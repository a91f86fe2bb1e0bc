"""The commands that work on files: replay, import, recover, as a user types them."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from rosbags.highlevel import AnyReader

from hil.command_line import main
from hil.lockstep.run import run_lockstep
from hil.log.reader import read_log
from hil.log.writer import LogWriter
from hil.scenario.files import load_scenario

TABLE = "t,r,b,u,v\n" + "".join(f"{100 + 0.1 * n:.1f},0.2,1.5708,0,0.1\n" for n in range(60))
COLUMNS = """
[columns]
t = "t"
rho = "r"
alpha2 = "b"
v2 = "v"
u2 = "u"
[truth]
v1 = "v"
u1 = "u"
[scenario.estimator]
front_end = "body"
[scenario.run]
evaluate_from_s = 102.0
"""
FOLLOWER_AT_ORIGIN = {"follower_x": 0, "follower_y": 0, "follower_theta": 0}
TOPICS = '[topics]\nrigid_bodies = "rigid_bodies"\nodometry = "follower/odom"\n'


class Said(NamedTuple):
    code: int
    out: str
    err: str


@pytest.fixture
def abreast(capsys: pytest.CaptureFixture[str]) -> Any:
    """Call the console script: exit code and what it said."""

    def call(*arguments: object) -> Said:
        capsys.readouterr()
        with pytest.raises(SystemExit) as left:
            main([str(argument) for argument in arguments])
        caught = capsys.readouterr()
        assert isinstance(left.value.code, int)
        return Said(left.value.code, caught.out, caught.err)

    return call


@pytest.fixture(scope="module")
def run_log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("run") / "run.mcap"
    settings = ["run.duration_s=3", "run.evaluate_from_s=1.5", "mocap.loss=0.05", "mocap.jitter_s=0.02"]
    run_lockstep(load_scenario("turtlebot3", settings), path)
    return path


@pytest.fixture
def imported(abreast: Any, tmp_path: Path) -> Path:
    (tmp_path / "lab.csv").write_text(TABLE)
    (tmp_path / "lab.toml").write_text(COLUMNS)
    out = tmp_path / "lab.mcap"
    said = abreast("import", "csv", tmp_path / "lab.csv", "--map", tmp_path / "lab.toml", "--out", out)
    assert said.code == 0
    assert said.err == ""
    assert "60 rows from 100 s to 105.9 s" in said.out
    return out


def summary(said: Said) -> dict[str, Any]:
    """The one JSON object that is all of stdout."""
    assert said.out.count("\n") == 1
    found = json.loads(said.out)
    assert isinstance(found, dict)
    return found


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as stream:
        return list(csv.DictReader(stream))


def test_a_simulation_is_told_in_words_and_six_digits(abreast: Any) -> None:
    said = abreast("simulate", "chain5", "--duration", "1")
    assert said.code == 0
    assert not said.err
    assert "recovered: yes\npairs: rho_final 0.5, settle_s 0, v_peak" in said.out
    assert not set("[]{}'") & set(said.out)


def test_verify_repeats_a_run_and_says_so(abreast: Any, run_log: Path, tmp_path: Path) -> None:
    said = abreast("replay", run_log, "--verify", "--strict", "--json", "--out", tmp_path / "out")
    assert said.code == 0
    found = summary(said)
    assert found["mode"] == "replay"
    log = read_log(run_log)
    for name, topic in (("estimates", "follower/leader_estimate"), ("commands", "follower/command")):
        logged = sum(1 for _ in log.records([topic]))
        assert found["parity"][name] == {"compared": logged, "mismatched": 0}
    assert found["estimation"]["rmse"]["v1"] < 0.004
    assert json.loads((tmp_path / "out" / "summary.json").read_text()) == found
    assert len(rows(tmp_path / "out" / "estimates.csv")) == found["parity"]["estimates"]["compared"]
    assert (tmp_path / "out" / "replay.png").read_bytes().startswith(b"\x89PNG")
    assert "<title>turtlebot3 · " in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")


def test_verify_fails_on_a_changed_estimate_and_names_the_first(
    abreast: Any, run_log: Path, tmp_path: Path
) -> None:
    log = read_log(run_log)
    with LogWriter(tmp_path / "bad.mcap", log.metadata) as out:
        for record in log.records():
            payload = bytearray(record.payload)
            if (record.topic, record.sequence) == ("follower/leader_estimate", 9):
                payload[44] ^= 1
            out.write(record.topic, record.typename, bytes(payload), record.log_ns, record.publish_ns)
    said = abreast("replay", tmp_path / "bad.mcap", "--verify", "--json")
    assert said.code == 1
    assert summary(said)["parity"]["estimates"]["mismatched"] == 1
    assert "1 of" in said.err
    assert "estimates differ (the first is number 10)" in said.err


def test_verify_of_a_log_without_estimates_fails(abreast: Any, imported: Path) -> None:
    said = abreast("replay", imported, "--verify", "--json")
    assert said.code == 1
    assert summary(said)["parity"]["estimates"] == {"compared": 0, "mismatched": 0}
    assert "nothing to verify" in said.err


@pytest.mark.slow
def test_another_estimator_has_its_own_figures(abreast: Any, run_log: Path) -> None:
    same = summary(abreast("replay", run_log, "--json"))
    other = summary(abreast("replay", run_log, "--estimator", "difference", "--json"))
    assert (same["estimator"], other["estimator"]) == ("ekf", "difference")
    assert "parity" not in same
    assert "commands" not in other
    assert other["estimation"]["rmse"]["v1"] > 1.1 * same["estimation"]["rmse"]["v1"]


@pytest.mark.slow
def test_from_and_to_limit_what_is_judged_and_not_what_is_stepped(
    abreast: Any, run_log: Path, tmp_path: Path
) -> None:
    whole, part = tmp_path / "whole.csv", tmp_path / "part.csv"
    assert abreast("replay", run_log, "--csv", whole).code == 0
    found = summary(abreast("replay", run_log, "--from", 1, "--to", 2, "--csv", part, "--json"))
    assert found["estimation"]["evaluated_from_s"] == pytest.approx(1.0)
    assert len(rows(part)) == pytest.approx(114, abs=8)
    times = [float(row["t"]) for row in rows(part)]
    assert max(times) - min(times) == pytest.approx(1.0, abs=0.03)
    assert all(row in rows(whole) for row in rows(part))


def test_an_imported_recording_keeps_its_own_time(abreast: Any, imported: Path, tmp_path: Path) -> None:
    table = tmp_path / "e.csv"
    said = abreast("replay", imported, "--from", 103, "--to", 104.5, "--csv", table, "--json")
    found = summary(said)
    assert found["estimation"]["evaluated_from_s"] == 103.0
    assert [row["t"] for row in rows(table)] == [f"{103 + 0.1 * n:.1f}00000000" for n in range(16)]
    # Seen to stand still at the side of a robot that drives straight, the leader drives as fast.
    assert float(rows(table)[-1]["v1"]) == pytest.approx(0.1, abs=0.005)
    assert summary(abreast("replay", imported, "--json"))["estimation"]["evaluated_from_s"] == 102.0


def test_strict_fails_where_an_error_is_outside_its_extended_bound(abreast: Any, tmp_path: Path) -> None:
    """A truth that claims 2 m/s of a leader seen at 0.1 m/s is further off than any bound allows."""
    (tmp_path / "lab.csv").write_text(TABLE)
    poses = {"leader_x": 0, "leader_y": 0.2, "leader_theta": 0, **FOLLOWER_AT_ORIGIN}
    claims = "".join(f"{name} = {{ constant = {value} }}\n" for name, value in {**poses, "v1": 2.0}.items())
    (tmp_path / "lab.toml").write_text(COLUMNS.replace('v1 = "v"\n', claims))
    log = tmp_path / "lab.mcap"
    abreast("import", "csv", tmp_path / "lab.csv", "--map", tmp_path / "lab.toml", "--out", log)
    loose, strict = abreast("replay", log, "--json"), abreast("replay", log, "--strict", "--json")
    assert (loose.code, strict.code) == (0, 1)
    assert summary(loose) == summary(strict)
    assert summary(strict)["bounds"]["violations"]["v1_extended"] > 0
    assert "bounds violated (samples): v1_extended by" in strict.err


def test_a_map_makes_a_log_of_another_make_replay(abreast: Any, run_log: Path, tmp_path: Path) -> None:
    log = read_log(run_log)
    with LogWriter(tmp_path / "other.mcap", {}) as out:
        for record in log.records(["rigid_bodies", "follower/odom"]):
            out.write(record.topic, record.typename, record.payload, record.log_ns, record.publish_ns)
    (tmp_path / "topics.toml").write_text(TOPICS)
    arguments = ("replay", tmp_path / "other.mcap", "--map", tmp_path / "topics.toml")
    said = abreast(*arguments, "--csv", tmp_path / "e.csv", "--estimator", "ukf", "--json")
    assert said.code == 0
    assert summary(said)["estimator"] == "ukf"
    assert rows(tmp_path / "e.csv")[200]["status"] == "tracking"
    assert abreast(*arguments, "--verify").code == 2
    said = abreast(*arguments, "--leader", "burger")
    assert said.code == 2
    assert "leader 'burger' is not among the bodies" in said.err


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--from", "2", "--to", "1"), "--to 1: expected more than --from 2"),
        (("--from", "100"), "no estimate between --from and --to; there are some from"),
        (("--estimator", "kalman"), "estimator.kind is 'kalman'"),
        (("--follower", "burger"), "follower 'burger' is not among the bodies"),
        (("--verify", "--estimator", "ukf"), "--verify compares with what was recorded: by ekf"),
        (("--map", "nowhere.toml"), "map 'nowhere.toml': no such name and no such file"),
        (("--csv", "/proc/none/e.csv"), "/proc/none/e.csv: cannot be written"),
        (("--frm", "1"), "is no option"),
    ],
)
def test_a_users_mistake_is_one_line_and_exit_code_2(
    options: tuple[str, ...], said: str, abreast: Any, run_log: Path
) -> None:
    answer = abreast("replay", run_log, *options)
    assert answer.code == 2
    assert answer.out == ""
    assert said in answer.err
    assert answer.err.count("\n") == 1


@pytest.mark.parametrize(("content", "said"), [(b"hello", "is not MCAP"), (None, "no such file")])
def test_a_file_that_is_no_log_is_one_line(
    content: bytes | None, said: str, abreast: Any, tmp_path: Path
) -> None:
    if content is not None:
        (tmp_path / "x.mcap").write_bytes(content)
    answer = abreast("replay", tmp_path / "x.mcap", "--json")
    assert (answer.code, answer.out) == (2, "")
    assert said in answer.err
    assert answer.err.count("\n") == 1


def test_a_cut_off_log_is_recovered_as_the_error_says(abreast: Any, run_log: Path, tmp_path: Path) -> None:
    cut, whole = tmp_path / "cut.mcap", tmp_path / "whole.mcap"
    cut.write_bytes(run_log.read_bytes()[:200_000])
    answer = abreast("replay", cut)
    assert answer.code == 2
    assert f"abreast recover {cut} --out LOG" in answer.err
    answer = abreast("recover", cut, "--out", whole)
    assert answer.code == 1
    assert "is cut off; its last" in answer.out
    assert "has what is left" in answer.err
    with AnyReader([whole]) as reader:
        assert reader.message_count > 500
    found = summary(abreast("replay", whole, "--verify", "--json"))
    assert found["parity"]["estimates"]["mismatched"] == 0
    assert abreast("recover", cut, "--out", whole).code == 2


def test_import_refuses_bad_rows_and_leaves_nothing(abreast: Any, tmp_path: Path) -> None:
    (tmp_path / "lab.csv").write_text(TABLE.replace(",0.2", ",far"))
    (tmp_path / "lab.toml").write_text(COLUMNS)
    out = tmp_path / "lab.mcap"
    answer = abreast("import", "csv", tmp_path / "lab.csv", "--map", tmp_path / "lab.toml", "--out", out)
    assert answer.code == 2
    assert "line 2, column 'r': 'far', expected a finite number" in answer.err
    assert answer.err.count("\n") == 1
    assert not out.exists()


def test_a_sensor_is_calibrated_and_replayed_as_the_command_says(abreast: Any, tmp_path: Path) -> None:
    rows = "".join(
        f"{100 + 0.1 * n:.1f},0.25,1.4708,0,0.1,{0.01 * n:.2f},0.2,0,{0.01 * n:.2f},0,0\n" for n in range(60)
    )
    (tmp_path / "lab.csv").write_text("t,r,b,u,v,lx,ly,lth,fx,fy,fth\n" + rows)
    truth = {
        "leader_x": "lx",
        "leader_y": "ly",
        "follower_x": "fx",
        "follower_y": "fy",
        "follower_theta": "fth",
    }
    named = "".join(f'{name} = "{column}"\n' for name, column in truth.items())
    (tmp_path / "lab.toml").write_text(COLUMNS.replace("[truth]\n", f"[truth]\n{named}"))
    out = tmp_path / "lab.mcap"
    abreast("import", "csv", tmp_path / "lab.csv", "--map", tmp_path / "lab.toml", "--out", out)
    answer = abreast("calibrate", out, "--to", "104", "--json")
    assert answer.code == 0
    found = json.loads(answer.out)
    assert found["range_bias"] == pytest.approx(0.05, abs=1e-6)
    assert found["bearing_bias"] == pytest.approx(-0.1, abs=1e-4)
    words = answer.err.split("abreast replay ")[1].split()
    table = tmp_path / "estimates.csv"
    assert abreast("replay", *words, "--csv", table).code == 0
    with table.open() as stream:
        last = list(csv.DictReader(stream))[-1]
    assert float(last["rho"]) == pytest.approx(0.2, abs=1e-3)
    assert float(last["alpha2"]) == pytest.approx(1.5708, abs=1e-3)
    assert abreast("calibrate", out, "--to", "100.5").code == 2
    answer = abreast("replay", *words, "--verify")
    assert answer.code == 2
    assert "--verify compares with what was recorded" in answer.err


def test_a_log_without_sightings_tells_the_timing_of_a_run_on_a_bad_network(
    abreast: Any, run_log: Path
) -> None:
    answer = abreast("calibrate", run_log, "--json")
    assert answer.code == 0
    found = json.loads(answer.out)
    assert found["delay_s"] == pytest.approx(0.1, abs=5e-3)
    assert "stamp_offset_s" not in found  # three seconds are too short
    assert "range_bias" not in found
    assert "offset of stamps unknown" in answer.err
