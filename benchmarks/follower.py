"""What `abreast follower` costs live: its round trip against null handlers, and how long a chain it carries.

    python benchmarks/follower.py trip [--rates 120,240] [--rounds 7] [--seconds 4]
    python benchmarks/follower.py chain [--ways follower,apart] [--followers 24,50] [--undisturbed]

``trip``: from a mocap frame's publication to the drive command that follows from it, all in one process that
plays motion capture and robot. The null handlers are two processes in the places of estimator and controller:
each answers in Zenoh's thread with bytes as many as an estimate and a drive command have, and does no more.
Every way has a router of its own; all take turns, and ratios are medians over the rounds.

``chain``: emulator and followers, a router, and a listener to what the followers decide: from the capture
that a command rests on to its reception there, less the emulated latency. With ``--recorder`` there is one of
these too. With ``--undisturbed`` all processes go before all others on the machine while it is measured, for
one that is busy; that takes the right to. Shares of a core are of all processes.
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import threading
import time
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import zenoh

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from formation.pose import Motion, Pose, advance
from hil.emulator.lab_messages import frame_message, odometry_message
from hil.live.crew import APART, TOGETHER, processes_of
from hil.scenario.files import load_scenario, scenario_text
from hil.scenario.links import links_of
from hil.wire import message_types as msg
from hil.wire import topics
from hil.wire.messages import decode_as, encode, to_ns
from hil.wire.pubsub import Wire
from hil.wire.session import Endpoints, close_session, open_session, reserved_endpoint
from hil.wire.topics import topics_of, urgent_topics
from hil.wire.undeclare import undeclare

PAIR, CHAIN = "turtlebot3", "chain5-turtlebot3"
TRIPS = {"null": (), "follower": ("follower",), "apart": ("controller", "estimator")}
WAYS = {"follower": TOGETHER, "apart": APART}
ESTIMATE_BYTES, DRIVE_BYTES = 388, 76
PATIENCE = 120.0
ODOMETRY_EVERY = 4
TARGET_RATIO, TARGET_MS = 1.3, 20.0


@contextmanager
def children(commands: dict[str, list[str]]) -> Iterator[dict[str, int]]:
    """Processes by name, as long as they are needed; their process ids."""
    here = [sys.executable, str(Path(__file__).resolve())]
    started: dict[str, subprocess.Popen[bytes]] = {}
    try:
        for name, words in commands.items():
            program = here if words[0] in ("null", "router") else [sys.executable, "-m", "hil"]
            started[name] = subprocess.Popen([*program, *words], stderr=subprocess.DEVNULL)
        yield {name: process.pid for name, process in started.items()}
    finally:
        for process in started.values():
            process.terminate()
        for process in started.values():
            process.wait()


def spent(pid: int) -> float:
    """Processor time of a process so far [s]."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def go_first(pids: Iterable[int], policy: int) -> None:
    """Schedule all threads of processes: before those of others by SCHED_RR, like them by SCHED_OTHER."""
    for pid in pids:
        for thread in Path(f"/proc/{pid}/task").iterdir():
            os.sched_setscheduler(int(thread.name), policy, os.sched_param(int(policy == os.SCHED_RR)))


def serve_router(endpoint: str) -> None:
    session = open_session(Endpoints(listen=endpoint))
    try:
        threading.Event().wait()
    finally:
        close_session(session)


def serve_null(endpoint: str, hear: str, say: str, size: int) -> None:
    """Answer everything on a topic with ``size`` bytes on another."""
    session = open_session(Endpoints(connect=endpoint))
    wire, answer = Wire(session, urgent_topics(load_scenario(PAIR))), bytes(size)
    wire.publish(say, answer)  # declares the topic, which Zenoh's thread must not do

    def reply(_: zenoh.Sample) -> None:
        wire.publish(say, answer)

    subscriber = session.declare_subscriber(hear, zenoh.handlers.Callback(reply, indirect=False))
    try:
        threading.Event().wait()
    finally:
        undeclare(subscriber)
        close_session(session)


class Lab:
    """Motion capture and robot of a pair that drives in a circle, on a router of its own."""

    def __init__(self, endpoint: str) -> None:
        scenario = load_scenario(PAIR)
        self.names = topics_of(scenario)
        self.session = open_session(Endpoints(connect=endpoint), patience=PATIENCE)
        self.wire = Wire(self.session, urgent_topics(scenario))
        self.answered_ns = 0
        self.answers = threading.Event()
        heard = zenoh.handlers.Callback(self._on_command, indirect=False)
        self._ear = self.session.declare_subscriber(self.names.cmd_vel, heard)
        self._poses, self._at = (Pose(0.0, 0.0, 0.0), Pose(0.0, -0.4, 0.0)), time.time_ns()

    def _on_command(self, _: zenoh.Sample) -> None:
        if not self.answers.is_set():
            self.answered_ns = time.perf_counter_ns()
            self.answers.set()

    def trips(self, rate: float, seconds: float) -> list[float]:
        """Times from a frame to the first command after it [ms]; a frame without one counts as its period."""
        period, found = 1.0 / rate, []
        due = time.perf_counter() + period
        for number in range(int(seconds * rate)):
            frame = self._next(number)
            time.sleep(max(0.0, due - time.perf_counter()))
            self.answers.clear()
            begun_ns = time.perf_counter_ns()
            self.wire.publish(topics.RIGID_BODIES, frame)
            # Odometry comes between two frames, so that neither way has to wait for it.
            answered = self.answers.wait(0.75 * period)
            found.append((self.answered_ns - begun_ns) * 1e-6 if answered else period * 1e3)
            due += period
        return found[len(found) // 5 :]

    def _next(self, number: int) -> bytes:
        now_ns = time.time_ns()
        dt, self._at = (now_ns - self._at) * 1e-9, now_ns
        motions = Motion(0.08, 0.1), Motion(0.12, 0.1)
        self._poses = tuple(  # type: ignore[assignment]
            advance(pose, *motion, min(dt, 0.1)) for pose, motion in zip(self._poses, motions, strict=True)
        )
        if number % ODOMETRY_EVERY == 0:
            odometry = odometry_message(now_ns, self.names.follower, self._poses[1], motions[1])
            self.wire.publish(self.names.odom, encode(odometry))
        bodies = zip((self.names.leader, self.names.follower), self._poses, strict=True)
        return encode(frame_message(now_ns, number, bodies))

    def close(self) -> None:
        undeclare(self._ear)
        self.wire.close()
        close_session(self.session)


def answering(way: str, endpoint: str) -> dict[str, list[str]]:
    """Processes of a way that answers frames."""
    names = topics_of(load_scenario(PAIR))
    started = {f"{way} router": ["router", endpoint]}
    if way == "null":
        sizes = str(ESTIMATE_BYTES), str(DRIVE_BYTES)
        started["null estimator"] = ["null", endpoint, topics.RIGID_BODIES, names.estimate, sizes[0]]
        started["null controller"] = ["null", endpoint, names.estimate, names.cmd_vel, sizes[1]]
    for daemon in TRIPS[way]:
        started[f"{way} {daemon}"] = [daemon, PAIR, "--connect", endpoint]
    return started


def measure_trips(rates: list[float], rounds: int, seconds: float) -> None:
    with ExitStack() as stack:
        endpoints = {way: stack.enter_context(reserved_endpoint()) for way in TRIPS}
        started = [answering(way, endpoint) for way, endpoint in endpoints.items()]
        stack.enter_context(children({name: words for each in started for name, words in each.items()}))
        labs = {way: Lab(endpoint) for way, endpoint in endpoints.items()}
        for lab in labs.values():
            stack.callback(lab.close)
            until = time.monotonic() + PATIENCE
            while statistics.median(lab.trips(rates[0], 1.0)) > 0.7e3 / rates[0]:
                assert time.monotonic() < until, "nobody answers"
        for rate in rates:
            # The ways swap places from round to round: none always comes after the same one.
            orders = [list(labs)[k % 3 :] + list(labs)[: k % 3] for k in range(rounds)]
            found = [{way: labs[way].trips(rate, seconds) for way in order} for order in orders]
            print(f"{rate:g} Hz, {rounds} rounds of {seconds:g} s, load {os.getloadavg()[0]:.1f}")
            for way in TRIPS:
                p50 = statistics.median(statistics.median(each[way]) for each in found)
                p99 = statistics.median(float(np.percentile(each[way], 99)) for each in found)
                ratio = statistics.median(
                    statistics.median(each[way]) / statistics.median(each["null"]) for each in found
                )
                met = ("  met" if ratio <= TARGET_RATIO else "  MISSED") if way == "follower" else ""
                print(f"  {way:10} {p50:6.3f} ms  p99 {p99:6.3f} ms  {ratio:5.2f} of null{met}", flush=True)


class Ear:
    """Keeps every decision of a chain's followers with when it came."""

    def __init__(self, endpoint: str) -> None:
        self.heard: list[tuple[int, str, bytes]] = []
        self.session = open_session(Endpoints(connect=endpoint), patience=PATIENCE)
        kept = zenoh.handlers.Callback(self._keep, indirect=False)
        self._subscriber = self.session.declare_subscriber("*/command", kept)

    def _keep(self, sample: zenoh.Sample) -> None:
        self.heard.append((time.time_ns(), str(sample.key_expr), sample.payload.to_bytes()))

    def wait_until_driven(self, followers: int) -> None:
        """Wait until the last robot has set off: each knows its predecessor only once that moves."""
        until = time.monotonic() + PATIENCE
        while time.monotonic() < until:
            self.heard.clear()
            time.sleep(1.0)
            newest = {topic: payload for _, topic, payload in self.heard}
            driven = sum(decode_as(payload, msg.Command).fresh for payload in newest.values())
            if driven >= 0.95 * followers:
                break
        self.heard.clear()

    def close(self) -> None:
        undeclare(self._subscriber)
        close_session(self.session)


def ages(heard: list[tuple[int, str, bytes]], latency_s: float) -> list[float]:
    """Age beyond the emulated latency of every measurement when the first command by it came [ms]."""
    found, newest = [], dict[str, int]()
    for came_ns, topic, payload in heard:
        capture_ns = to_ns(decode_as(payload, msg.Command).capture)
        if capture_ns > newest.get(topic, 0):
            newest[topic] = capture_ns
            found.append((came_ns - capture_ns) * 1e-6 - latency_s * 1e3)
    return found


def measure_chain(
    way: str, followers: int, seconds: float, *, recorder: bool = False, undisturbed: bool = False
) -> None:
    scenario = load_scenario(CHAIN, [f"chain.agents={followers + 1}", "run.duration_s=3600"])
    with ExitStack() as stack:
        endpoint = stack.enter_context(reserved_endpoint())
        folder = Path(stack.enter_context(TemporaryDirectory()))
        resolved = folder / "scenario.toml"
        resolved.write_text(scenario_text(scenario), encoding="utf-8")
        commands = {"router": ["router", endpoint]}
        for name, daemon, served in processes_of(links_of(scenario), WAYS[way]):
            if daemon == "recorder" and not recorder:
                continue
            commands[name] = [daemon, str(resolved), "--connect", endpoint]
            commands[name] += [word for each in served for word in ("--follower", each)]
            if daemon == "recorder":
                commands[name] += ["--out", str(folder / "run.mcap")]
        pids = stack.enter_context(children(commands))
        ear = Ear(endpoint)
        stack.callback(ear.close)
        ear.wait_until_driven(followers)
        if undisturbed:
            go_first([*pids.values(), os.getpid()], os.SCHED_RR)
            time.sleep(1.0)
            ear.heard.clear()
        before, begun = {name: spent(pid) for name, pid in pids.items()}, time.monotonic()
        time.sleep(seconds)
        heard, took = list(ear.heard), time.monotonic() - begun
        shares = {name: (spent(pid) - before[name]) / took for name, pid in pids.items()}
        if undisturbed:
            go_first([*pids.values(), os.getpid()], os.SCHED_OTHER)
        found = ages(heard, scenario.mocap.latency_s)
        due = followers * took * scenario.mocap.rate_hz
        p50, p99 = np.percentile(found, [50, 99]) if found else (np.nan, np.nan)
        print(
            f"{way:9} {followers:3} followers  p50 {p50:7.1f} ms  p99 {p99:7.1f} ms"
            f"{'  met' if p99 < TARGET_MS else '  MISSED'}  {100 * len(found) / due:5.1f} % of frames"
            f"  load {os.getloadavg()[0]:.1f}  cores: "
            + ", ".join(f"{name} {share:.2f}" for name, share in shares.items()),
            flush=True,
        )


def main() -> None:
    if sys.argv[1:2] == ["router"]:
        return serve_router(sys.argv[2])
    if sys.argv[1:2] == ["null"]:
        endpoint, hear, say, size = sys.argv[2:6]
        return serve_null(endpoint, hear, say, int(size))
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("what", choices=["trip", "chain"])
    parser.add_argument("--rates", default="120,240")
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--seconds", type=float)
    parser.add_argument("--ways", default="follower")
    parser.add_argument("--followers", default="24,50")
    parser.add_argument("--recorder", action="store_true")
    parser.add_argument("--undisturbed", action="store_true")
    given = parser.parse_args()
    if given.what == "trip":
        rates = [float(rate) for rate in given.rates.split(",")]
        return measure_trips(rates, given.rounds, given.seconds or 4.0)
    for count in given.followers.split(","):
        for way in given.ways.split(","):
            options = {"recorder": given.recorder, "undisturbed": given.undisturbed}
            measure_chain(way, int(count), given.seconds or 10.0, **options)
    return None


if __name__ == "__main__":
    main()
