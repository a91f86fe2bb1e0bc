"""The live page of a run: it shows it, stops it, and is nothing that a run depends on."""

from __future__ import annotations

import errno
import json
import os
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest
from selenium.webdriver import Chrome
from selenium.webdriver.common.keys import Keys

from hil.live_page.page_process import PageProcess
from hil.wire.session import Endpoints
from tests.hil.live_page.watched_page import WatchedPage

PATIENCE = 300.0


@contextmanager
def shown_run(folder: Path, duration_s: float, *options: str) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """A run with its page, and the address of that."""
    words = [sys.executable, "-m", "hil", "run", "--live", "--json", "--out", str(folder)]
    process = subprocess.Popen(
        [*words, "--duration", str(duration_s), *options],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stderr is not None
    try:
        line = next(line for line in process.stderr if "shown at" in line)
        yield process, line.split()[-1]
    finally:
        with suppress(ProcessLookupError):
            process.send_signal(signal.SIGINT)
        process.communicate(timeout=PATIENCE)


def page_processes(folder: Path) -> list[int]:
    """Ids of the processes of a run's page."""
    found = []
    for entry in Path("/proc").iterdir():
        with suppress(OSError):
            words = (entry / "cmdline").read_bytes().split(b"\0") if entry.name.isdecimal() else []
            if b"live" in words and str(folder / "scenario.toml").encode() in words:
                found.append(int(entry.name))
    return found


def test_a_run_is_watched_and_stopped_by_the_space_bar(chrome: Chrome, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    with shown_run(folder, 120.0) as (process, address):
        page = WatchedPage(chrome, address)
        page.wait_until(lambda: page.is_live() and "tracking" in page.text("verdict"))
        page.wait_until(lambda: min(page.colours()) >= 1)
        page.wait_until(lambda: page.script("return strips.textContent").count("–") == 0)
        page.press(Keys.SPACE)
        page.wait_until(lambda: "follower stands" in page.text("stopped"))
        page.wait_until(lambda: "the run is over" in page.text("alarm"))
        assert process.wait(timeout=PATIENCE) == 1
        assert process.stdout is not None
        summary = json.loads(process.stdout.read())
        assert summary["stopped_by"]
        assert "stopped by hand on the live page" in json.dumps(summary["findings"])
    assert page_processes(folder) == []


def test_a_page_that_is_killed_comes_back_and_the_run_goes_on(chrome: Chrome, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    with shown_run(folder, 20.0) as (process, address):
        page = WatchedPage(chrome, address)
        page.wait_until(page.is_live)
        (first,) = page_processes(folder)
        os.kill(first, signal.SIGKILL)
        page.wait_until(lambda: not page.is_live())
        page.wait_until(page.is_live)
        assert page_processes(folder) != [first]
        out, err = process.communicate(timeout=PATIENCE)
        assert process.returncode == 0, err
        assert "the live page ended with exit code -9; it is started again" in " ".join(err.split())
        assert json.loads(out)["commands"]
    assert page_processes(folder) == []


def test_a_run_that_is_killed_leaves_no_page(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    with shown_run(folder, 60.0) as (process, _):
        until = time.monotonic() + PATIENCE
        while not page_processes(folder):
            assert time.monotonic() < until
            time.sleep(0.1)
        process.kill()
        while page_processes(folder):
            assert time.monotonic() < until
            time.sleep(0.1)


def test_elsewhere_the_address_has_a_token(tmp_path: Path) -> None:
    with shown_run(tmp_path / "run", 1.0, "--live-address", "0.0.0.0") as (_, address):
        assert re.fullmatch(r"http://[\w.\-\[\]:]+:\d+/#[\w-]{16,}", address)


def test_a_page_that_cannot_be_started_is_said_once_and_tried_again(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    tries, lines, now = list[float](), list[str](), [0.0]

    def begin(*_: object, **__: object) -> None:
        tries.append(now[0])
        raise OSError(errno.EAGAIN, os.strerror(errno.EAGAIN))

    with socket.create_server(("127.0.0.1", 0)) as listening:
        page = PageProcess(listening, "", lines.append)
        monkeypatch.setattr(page, "_clock", lambda: now[0])
        with monkeypatch.context() as failing:
            failing.setattr(subprocess, "Popen", begin)
            for now[0] in (0.0, 1.0, 2.0, 3.0, 4.0):
                page.see_to(tmp_path / "scenario.toml", Endpoints())
    page.close()
    assert tries == [0.0, 2.0, 4.0]
    assert lines == [f"the live page cannot be started: {os.strerror(errno.EAGAIN)}; it is tried again"]
