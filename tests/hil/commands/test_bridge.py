"""What ``abreast bridge`` and ``abreast emulator --natnet`` say of mistakes: one line, and exit code 2."""

from __future__ import annotations

import sys

import pytest

from hil.bridge.datagram_sockets import open_socket
from hil.command_line import main

NATNET = ("bridge", "natnet", "turtlebot3", "--server")
MOCAP = ("bridge", "mocap", "turtlebot3", "--server", "192.0.2.1")
EMULATOR = ("emulator", "turtlebot3", "--natnet")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((*NATNET, "no-such-host.invalid"), "no-such-host.invalid': no such host"),
        ((*NATNET, "192.0.2.1:99999"), "192.0.2.1:99999': expected HOST or HOST:PORT"),
        ((*NATNET, "192.0.2.1", "--set", 'source.type="TFMessage"'), "the bridge publishes RigidBodies"),
        ((*NATNET, "192.0.2.1", "--up", "x"), "'x' is not one of 'y', 'z'"),
        ((*MOCAP, "--type", "vicon"), "pip install 'abreast[mocap]'"),
        ((*MOCAP, "--type", "kinect"), "'kinect' is not one of"),
        ((*EMULATOR, "--natnet-version", "2.9"), "2.9: expected 3.0, 3.1, 4.0, 4.1"),
        ((*EMULATOR, "--natnet-address", "nowhere.invalid"), "no such host"),
    ],
)
def test_a_mistake_is_told_in_one_line(
    arguments: tuple[str, ...],
    words: str,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(sys.modules, "motioncapture", None)
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    told = capsys.readouterr()
    assert ended.value.code == 2
    assert told.out == ""
    assert words in told.err
    assert told.err.count("\n") == 1


def test_a_port_that_is_taken_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    with open_socket("127.0.0.1") as taken:
        port = str(taken.getsockname()[1])
        with pytest.raises(SystemExit) as ended:
            main([*EMULATOR, "--natnet-command-port", port])
    assert ended.value.code == 1
    assert capsys.readouterr().err.count(f"UDP 127.0.0.1:{port}: Address already in use") == 1
