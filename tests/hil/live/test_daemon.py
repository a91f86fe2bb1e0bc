"""The daemons one by one, as a lab starts them on its machines."""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

from hil.live.daemon import NodeWorker
from hil.log.metadata import scenario_of
from hil.log.reader import read_log
from hil.nodes.lockstep_run import make_nodes
from hil.nodes.node import TICK, Event
from hil.replay.rerun import replay
from hil.scenario.files import load_scenario
from hil.wire.session import free_endpoint
from tests.hil.live.child_run import PATIENCE


def daemon(name: str, folder: Path, *options: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "hil", name, "turtlebot3", *options],
        cwd=folder,
        stderr=subprocess.PIPE,
        text=True,
    )


def wait_until_ready(name: str, process: subprocess.Popen[str], endpoint: str) -> None:
    assert process.stderr is not None
    assert process.stderr.readline().startswith(f"abreast {name}: ready, turtlebot3 on {endpoint}")


def test_daemons_started_by_hand_find_each_other_and_end_when_told(tmp_path: Path) -> None:
    endpoint = free_endpoint()
    daemons = {
        "recorder": daemon("recorder", tmp_path, "--listen", endpoint, "--out", "lab.mcap"),
        "estimator": daemon("estimator", tmp_path, "--connect", endpoint),
        "controller": daemon("controller", tmp_path, "--connect", endpoint),
    }
    try:
        for name, process in daemons.items():
            wait_until_ready(name, process, endpoint)
        daemons["emulator"] = daemon("emulator", tmp_path, "--connect", endpoint, "--duration", "4")
        wait_until_ready("emulator", daemons["emulator"], endpoint)
        assert daemons["emulator"].wait(PATIENCE) == 0
        daemons["controller"].terminate()
        daemons["estimator"].send_signal(2)
        for name in ("controller", "estimator"):
            assert daemons[name].wait(PATIENCE) == 0
        time.sleep(0.2)
        daemons["recorder"].terminate()
        assert daemons["recorder"].wait(PATIENCE) == 0
    finally:
        for process in daemons.values():
            process.kill()
            process.communicate()
    log = read_log(tmp_path / "lab.mcap")
    scenario = scenario_of(log)
    assert scenario is not None
    parity = replay(log, scenario).parity
    assert parity["estimates"].compared > 100
    assert [part.mismatched for part in parity.values()] == [0, 0]


def test_nodes_that_share_a_process_do_what_they_would_do_alone() -> None:
    emulator, *estimators = make_nodes(load_scenario("chain5-turtlebot3", ["chain.agents=3"]))[:3]
    together = NodeWorker(estimators)
    alone = [NodeWorker([node]) for node in estimators]
    world, now_ns = emulator.begin(0), 0
    for worker in (together, *alone):
        worker.begin(0)
    said = [0, 0]
    while now_ns < 500_000_000:
        now_ns = emulator.due_ns(world)
        world, sent = emulator.step(world, TICK, now_ns)
        events = [TICK, *(Event(message.topic, message.payload) for message in sent)]
        for event in events:
            each = [
                worker.take(event, now_ns) if event.topic in worker.subscribes or not event.topic else ()
                for worker in alone
            ]
            assert together.take(event, now_ns) == tuple(message for out in each for message in out)
            said = [count + len(out) for count, out in zip(said, each, strict=True)]
    assert min(said) > 50
    assert together.due_ns() == min(worker.due_ns() for worker in alone)
    assert len(together.end(now_ns)) == 2
