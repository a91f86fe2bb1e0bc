"""A topic on which more comes than anybody sends who is sane: it is named, and the robot drives on."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from hil.live.flood_watch import FloodWatch
from hil.nodes.findings import findings_in
from hil.wire.events import Event
from hil.wire.intake import Intake
from hil.wire.message_types import DiagnosticArray
from hil.wire.messages import decode_as
from hil.wire.session import reserved_endpoint
from tests.hil.live.child_run import PATIENCE, Run

S = 1_000_000_000


def test_a_flood_is_reported_by_topic_and_rate_while_it_lasts_and_once_more_when_it_is_over() -> None:
    intake, heard = Intake(), list[bytes]()
    watch = FloodWatch("follower", intake, heard.append)
    said = []
    for tick in range(8):
        flooded = 2 <= tick < 5
        count, spacing_ns = (5_000, 100_000) if flooded else (10, 50_000_000)
        for k in range(1, count + 1):
            intake.takes(Event("follower/odom", b""), tick * S // 2 + k * spacing_ns)
        said.append([each.payload for each in watch.reports(10**18 + tick * S // 2, (tick + 1) * S // 2)])
    assert [len(each) for each in said] == [0, 0, 1, 1, 1, 1, 0, 0]
    assert heard == [payload for each in said for payload in each]
    *floods, over = [findings_in(decode_as(each, DiagnosticArray))["follower_intake"] for each in heard]
    assert all(each["flood"].startswith("10000 messages a second on follower/odom") for each in floods)
    assert not over


@pytest.mark.slow
@pytest.mark.parametrize("topic", ["follower/odom", "rigid_bodies", "diagnostics"])
def test_a_live_pair_drives_on_through_a_flood_and_names_it(tmp_path: Path, topic: str) -> None:
    with reserved_endpoint() as endpoint:
        where = ["--listen", endpoint, "--out", str(tmp_path / "run"), "--json", "--duration", "6"]
        process = subprocess.Popen(
            [sys.executable, "-m", "hil", "run", "turtlebot3", *where, "--set", "run.evaluate_from_s=2.0"],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        flooder = subprocess.Popen(
            [sys.executable, "-m", "tests.hil.live.flooder", endpoint, topic, "5000"],
            stdout=subprocess.DEVNULL,
        )
        try:
            code, summary, err = Run(tmp_path / "run", endpoint, process, 4).finish()
        finally:
            for each in (process, flooder):
                each.kill()
                each.wait(PATIENCE)
    assert code in (0, 1), err
    assert summary, err
    floods = [each["text"] for each in summary["findings"] if each["name"] == "flood"]
    assert floods
    assert f" on {topic}, " in floods[0]
    # On a machine that is busy with three more processes some commands may be late.
    assert summary["commands"]["stopped"] < summary["commands"]["sent"] / 2
