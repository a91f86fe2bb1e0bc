from __future__ import annotations

import csv
import dataclasses
import math
from pathlib import Path

import numpy as np
import pandas as pd
import polars as pl
import pytest
from pyarrow import parquet

from estimation.tracking.tracker import Status
from hil.errors import UsageError
from hil.exports.aligned_columns import ALIGNED_COLUMNS
from hil.exports.refusal import refuse_present
from hil.exports.table_export import TABLES, export_tables
from hil.judge.columns import columns_of
from hil.judge.estimation import errors_at
from hil.judge.replayed import ReplayChoice
from hil.judge.run_data import run_data_of_log
from hil.judge.summary import summarise
from hil.lockstep.run import run_lockstep
from hil.log.opened import opened_log
from hil.log.reader import Log, read_log
from hil.log.writer import LogWriter
from hil.replay.estimate_csv import write_estimates
from hil.scenario.files import load_scenario
from hil.wire.message_types import Command, LeaderEstimate
from hil.wire.messages import encode, to_ns

RECORDED = ReplayChoice(in_messages=True)


@pytest.fixture(scope="module")
def folder(short_log: Log, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("tables")
    assert export_tables(short_log, folder, "parquet", RECORDED).estimates == "recorded"
    return folder


def logged(log: Log, topic: str) -> list[tuple[int, object]]:
    return [(record.log_ns, log.decode(record)) for record in log.records([topic])]


def test_estimates_are_those_of_the_log_as_replay_writes_them(
    folder: Path, short_log: Log, tmp_path: Path
) -> None:
    estimates = [each for _, each in logged(short_log, "follower/leader_estimate")]
    write_estimates([each for each in estimates if isinstance(each, LeaderEstimate)], tmp_path / "e.csv")
    known = pd.read_csv(tmp_path / "e.csv")
    table = pd.read_parquet(folder / "aligned.parquet")
    assert len(table) == len(known) > 500
    pd.testing.assert_frame_equal(table[list(known.columns)], known, check_dtype=False, rtol=1e-15)
    assert table.time_ns.tolist() == [to_ns(each.header.stamp) for each in estimates]  # type: ignore[attr-defined]


def test_errors_and_truth_are_those_of_the_judge(folder: Path, short_log: Log) -> None:
    table = pl.read_parquet(folder / "aligned.parquet")
    columns = columns_of(run_data_of_log(short_log))
    for name, error in errors_at(columns.estimates, columns.truth.at(columns.estimates.capture_ns)).items():
        np.testing.assert_array_equal(table[f"error_{name}"].to_numpy(), error)
    rebuilt = table["true_alpha1"] + table["error_alpha1"] - table["alpha1"]
    assert np.allclose(np.cos(rebuilt.drop_nans().to_numpy()), 1.0)
    assert table.filter(pl.col("status") == "tracking")["error_v1"].abs().max() < 0.05  # type: ignore[operator]


def test_judged_rows_have_the_rmse_of_the_summary(folder: Path, short_log: Log) -> None:
    table = pd.read_parquet(folder / "aligned.parquet")
    told = summarise(run_data_of_log(short_log))["estimation"]
    assert table.judged.dtype == bool
    assert table.judged.sum() == told["samples"] < (table.status == "tracking").sum()
    judged = table[table.judged]
    for name in ("v1", "alpha1"):
        error = judged[f"error_{name}"]
        assert (error**2).mean() ** 0.5 == pytest.approx(told["rmse"][name], rel=1e-12)
        assert error.abs().max() == pytest.approx(told["max"][name], rel=1e-12)


def test_what_the_judge_leaves_out_of_a_log_is_not_judged(short_log: Log, tmp_path: Path) -> None:
    with LogWriter(tmp_path / "odd.mcap", short_log.metadata) as writer:
        for record in short_log.records():
            payload = record.payload
            if record.topic == "follower/leader_estimate":
                told = short_log.decode(record)
                assert isinstance(told, LeaderEstimate)
                odd = told.header.stamp.nanosec % 7 == 0
                payload = encode(dataclasses.replace(told, v1=math.inf)) if odd else payload
            writer.write(record.topic, record.typename, payload, record.log_ns, record.publish_ns)
    log = read_log(tmp_path / "odd.mcap")
    export_tables(log, tmp_path / "out", "parquet", RECORDED)
    table = pd.read_parquet(tmp_path / "out/aligned.parquet")
    assert np.isinf(table.v1).any()
    assert not table.judged[np.isinf(table.v1)].any()
    assert table.judged.sum() == summarise(run_data_of_log(log))["estimation"]["samples"]


def test_the_command_in_force_is_the_last_one_issued_by_then(folder: Path, short_log: Log) -> None:
    table = pd.read_parquet(folder / "aligned.parquet")
    commands = [each for _, each in logged(short_log, "follower/command") if isinstance(each, Command)]
    seen = 0
    for row in table.iloc[::37].itertuples():
        before = [each for each in commands if to_ns(each.header.stamp) <= row.time_ns]
        after = [each for each in commands if to_ns(each.capture) == row.time_ns and each.fresh]
        if not before:
            assert math.isnan(row.command_v2)
            continue
        last = before[-1]
        assert (row.command_v2, row.command_u2, row.command_stop) == (last.v2, last.u2, last.stop)
        assert row.command_age == pytest.approx((row.time_ns - to_ns(last.header.stamp)) * 1e-9)
        if after:
            assert row.delay_commanded == pytest.approx(to_ns(after[0].header.stamp) * 1e-9 - row.t, abs=1e-6)
            seen += 1
    assert seen > 5
    assert set(table.command_stop) > {""}


def test_time_counts_from_when_the_leader_set_off(folder: Path, short_log: Log) -> None:
    table = pl.read_parquet(folder / "aligned.parquet")
    zero_ns = run_data_of_log(short_log).zero_ns
    assert table["t_run"].to_list() == [(each - zero_ns) * 1e-9 for each in table["time_ns"].to_list()]


def test_units_and_meanings_are_in_the_parquet(folder: Path) -> None:
    schema = parquet.read_schema(folder / "aligned.parquet")
    assert schema.names == [column.name for column in ALIGNED_COLUMNS]
    assert schema.field("rho").metadata == {b"unit": b"m", b"description": b"distance between the robots"}
    assert all(b"description" in schema.field(name).metadata for name in schema.names)
    of_topic = parquet.read_schema(folder / "topics/follower/leader_estimate.parquet")
    assert of_topic.field("rho_dot").metadata == {b"unit": b"m/s"}


def test_the_docs_have_the_columns_of_the_code() -> None:
    text = (Path(__file__).parents[3] / "docs/export.md").read_text(encoding="utf-8")
    rows = [line.strip("|").split("|") for line in text.splitlines() if line.startswith("| `")]
    told = [tuple(cell.strip().strip("`") for cell in row) for row in rows]
    assert told == [tuple(column) for column in ALIGNED_COLUMNS]


def test_csv_holds_the_same_and_says_what_columns_are(folder: Path, short_log: Log, tmp_path: Path) -> None:
    export_tables(short_log, tmp_path, "csv", RECORDED)
    wanted = pd.read_parquet(folder / "aligned.parquet")
    found = pd.read_csv(tmp_path / "aligned.csv", keep_default_na=False, na_values={"nis": [""]})
    texts = [name for name in wanted if wanted[name].dtype.kind not in "if"]
    assert (found[texts] == wanted[texts]).all(axis=None)
    numbers = pd.read_csv(tmp_path / "aligned.csv")[wanted.columns.difference(texts)]
    pd.testing.assert_frame_equal(
        numbers, wanted[wanted.columns.difference(texts)], check_dtype=False, rtol=1e-15
    )
    with (tmp_path / "columns.csv").open(newline="", encoding="utf-8") as stream:
        assert [tuple(row) for row in csv.reader(stream)][1:] == [tuple(each) for each in ALIGNED_COLUMNS]


def test_a_chain_has_the_rows_of_every_follower(tmp_path: Path) -> None:
    run_lockstep(load_scenario("chain5-turtlebot3", ["run.duration_s=2.0"]), tmp_path / "run.mcap")
    done = export_tables(read_log(tmp_path / "run.mcap"), tmp_path / "all", "parquet", RECORDED)
    table = pl.read_parquet(tmp_path / "all/aligned.parquet")
    assert dict(table["follower"].value_counts().iter_rows()) == done.rows
    assert list(done.rows) == ["follower", "agent3", "agent4", "agent5"]
    one = dataclasses.replace(RECORDED, follower="agent4")
    export_tables(read_log(tmp_path / "run.mcap"), tmp_path / "one", "parquet", one)
    alone = pl.read_parquet(tmp_path / "one/aligned.parquet")
    assert alone.equals(table.filter(pl.col("follower") == "agent4"), null_equal=True)


def test_another_estimator_is_asked_anew(short_log: Log, folder: Path, tmp_path: Path) -> None:
    choice = dataclasses.replace(RECORDED, estimator="difference")
    assert export_tables(short_log, tmp_path, "parquet", choice).estimates == "replayed"
    anew, before = (pl.read_parquet(each / "aligned.parquet") for each in (tmp_path, folder))
    assert anew["time_ns"].equals(before["time_ns"])
    assert not anew["v1"].equals(before["v1"])


def test_a_foreign_log_is_put_through_the_estimator(short_log: Log, tmp_path: Path) -> None:
    with LogWriter(tmp_path / "bag.mcap", {}) as writer:
        for record in short_log.records(["rigid_bodies", "follower/odom"]):
            topic = record.topic.replace("rigid_bodies", "mocap/all")
            writer.write(topic, record.typename, record.payload, record.log_ns, record.publish_ns)
    (tmp_path / "map.toml").write_text('[topics]\nrigid_bodies = "mocap/all"\nodometry = "follower/odom"\n')
    choice = dataclasses.replace(RECORDED, chart=str(tmp_path / "map.toml"))
    export_tables(read_log(tmp_path / "bag.mcap"), tmp_path / "out", "parquet", choice)
    table = pl.read_parquet(tmp_path / "out/aligned.parquet")
    assert (table["status"] == Status.TRACKING.name.lower()).sum() > 300
    assert table["true_v1"].is_nan().all()
    assert pl.read_parquet(tmp_path / "out/topics/mocap/all.parquet").height == len(
        logged(read_log(tmp_path / "bag.mcap"), "mocap/all")
    )


def test_of_a_damaged_log_what_is_whole_is_written(short_log: Log, tmp_path: Path) -> None:
    torn = bytearray(short_log.path.read_bytes())
    middle = short_log.chunks[len(short_log.chunks) // 2].offset + 100
    torn[middle : middle + 40] = bytes(40)
    (tmp_path / "torn.mcap").write_bytes(torn)
    done = export_tables(opened_log(tmp_path / "torn.mcap"), tmp_path / "out", "parquet", RECORDED)
    assert "damaged" in done.damage
    rows = pl.read_parquet(tmp_path / "out/aligned.parquet").height
    whole = len(logged(short_log, "follower/leader_estimate"))
    assert 0.5 * whole < rows < whole


def test_what_lies_there_is_not_written_over(folder: Path, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="--overwrite"):
        refuse_present(folder, TABLES)
    refuse_present(tmp_path, TABLES)
