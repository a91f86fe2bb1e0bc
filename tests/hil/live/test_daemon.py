"""The daemons one by one, as a lab starts them on its machines."""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

from hil.log.metadata import scenario_of
from hil.log.reader import read_log
from hil.replay.rerun import replay
from hil.wire.session import free_endpoint


def daemon(name: str, folder: Path, *options: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "hil", name, "turtlebot3", *options],
        cwd=folder,
        stderr=subprocess.PIPE,
        text=True,
    )


def test_daemons_started_by_hand_find_each_other_and_end_when_told(tmp_path: Path) -> None:
    endpoint = free_endpoint()
    recorder = daemon("recorder", tmp_path, "--listen", endpoint, "--out", "lab.mcap")
    others = {
        "estimator": daemon("estimator", tmp_path, "--connect", endpoint),
        "controller": daemon("controller", tmp_path, "--connect", endpoint),
        "emulator": daemon("emulator", tmp_path, "--connect", endpoint, "--duration", "8"),
    }
    try:
        assert others["emulator"].wait(timeout=60) == 0
        others["controller"].terminate()
        others["estimator"].send_signal(2)
        for name, process in others.items():
            assert f"abreast {name}: ready, turtlebot3 on {endpoint}" in process.communicate(timeout=20)[1]
            assert process.returncode == 0
        time.sleep(0.2)
        recorder.terminate()
        assert recorder.communicate(timeout=20) is not None
        assert recorder.returncode == 0
    finally:
        for process in (recorder, *others.values()):
            process.kill()
            process.communicate()
    log = read_log(tmp_path / "lab.mcap")
    scenario = scenario_of(log)
    assert scenario is not None
    parity = replay(log, scenario).parity
    assert parity["estimates"].compared > 100
    assert [part.mismatched for part in parity.values()] == [0, 0]
