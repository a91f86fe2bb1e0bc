"""What the live page costs the loop: ``python -m benchmarks.live_cost [--rounds 7] [--duration 15]``.

Live runs of the turtlebot3 scenario at 240 frames a second without the motion capture's own latency, by turns
without the page, with the page while nobody looks, and while somebody does: a process that acknowledges every
frame as a browser on another machine would. Of each run the median and the 99th percentile from a capture to
its command are taken, of all runs of a kind their medians; the share is that over the runs without the page.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import json
import statistics
import subprocess
import sys
import tempfile
import urllib.request
from pathlib import Path

from tornado.httpclient import HTTPRequest
from tornado.websocket import WebSocketClosedError, websocket_connect

from hil.live.priority import step_aside

KINDS = ("no page", "nobody looks", "looked at")
_SETTINGS = ("mocap.rate_hz=240", "mocap.latency_s=0")


async def look(host: str) -> None:
    """Look on until the server goes; as cheap as can be and last in line, as a browser is elsewhere."""
    with urllib.request.urlopen(f"http://{host}/token") as answer:
        token = answer.read().decode()
    socket = await websocket_connect(HTTPRequest(f"ws://{host}/lab", headers={"Origin": f"http://{host}"}))
    await socket.write_message(json.dumps({"say": "hello", "token": token}))
    while (text := await socket.read_message()) is not None:
        number, found, _ = str(text)[5:24].partition(",")
        if found and number.isdecimal():
            with contextlib.suppress(WebSocketClosedError):
                await socket.write_message(f'{{"say":"seen","frame":{number}}}')


def run(kind: str, duration_s: float, folder: Path) -> dict[str, float]:
    """Latency of a run [ms]."""
    words = [
        sys.executable,
        "-m",
        "hil",
        "run",
        "--duration",
        str(duration_s),
        "--out",
        str(folder),
        "--json",
    ]
    for each in _SETTINGS:
        words += ["--set", each]
    if kind != KINDS[0]:
        words.append("--live")
    process = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout is not None
    assert process.stderr is not None
    looker = None
    for line in process.stderr:
        if kind == KINDS[2] and "shown at http://" in line:
            host = line.split()[-1].split("/")[2]
            looking = [sys.executable, "-m", "benchmarks.live_cost", "--look", host]
            looker = subprocess.Popen(looking, start_new_session=True)
    summary = json.loads(process.stdout.read())
    process.wait()
    if looker is not None:
        looker.wait()
    latency = summary["latency_ms"]["capture_to_command"]
    return {"p50": latency["p50"], "p99": latency["p99"]}


def main(rounds: int, duration_s: float) -> None:
    """Run all kinds by turns, and print what they took."""
    took: dict[str, list[dict[str, float]]] = {kind: [] for kind in KINDS}
    with tempfile.TemporaryDirectory() as folder:
        for number in range(rounds):
            for place, kind in enumerate(KINDS):
                took[kind].append(run(kind, duration_s, Path(folder) / f"{number}{place}"))
    base = {key: statistics.median(each[key] for each in took[KINDS[0]]) for key in ("p50", "p99")}
    for kind, runs in took.items():
        middle = {key: statistics.median(each[key] for each in runs) for key in base}
        print(
            f"{kind:12s}  p50 {middle['p50']:.3f} ms ({middle['p50'] / base['p50'] - 1:+.1%})  "
            f"p99 {middle['p99']:.2f} ms ({middle['p99'] / base['p99'] - 1:+.1%})  of {len(runs)} runs"
        )


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--duration", type=float, default=15.0)
    parser.add_argument("--look", default="")
    given = parser.parse_args()
    if given.look:
        step_aside(19)
        asyncio.run(look(given.look))
    else:
        main(given.rounds, given.duration)
