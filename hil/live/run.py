"""A live run: a router, its daemons as processes, and a supervisor that stops the robots if one fails.

Followers share a process, and in a long chain there are several of these. With estimators and controllers
apart, the controllers share one, the estimators one for every few of them.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from formation.pose import STANDSTILL
from hil.errors import UsageError
from hil.live.child_processes import Children
from hil.live.daemon import Ending
from hil.live.run_monitor import RunMonitor, Snapshot
from hil.scenario.files import scenario_text
from hil.scenario.links import HOSTED, Link, links_of, node_names
from hil.scenario.schema import Scenario
from hil.wire import message_types as msg
from hil.wire import topics
from hil.wire.drive_message import drive_message
from hil.wire.key_layout import layout_of
from hil.wire.messages import encode
from hil.wire.pubsub import Wire
from hil.wire.session import Endpoints, close_session, open_session
from hil.wire.topics import link_topics, urgent_topics

TOGETHER = ("recorder", "follower", "emulator")
APART = ("recorder", "estimator", "controller", "emulator")
"""The daemons of a run with estimator and controller of a follower in one process, and in two."""

FOLLOWERS_PER_PROCESS = {"follower": 32, "estimator": 4}
"""A process in Python keeps up with that many at 120 frames a second."""

START_TIMEOUT = 120.0
"""For the start barrier, from when a daemon was last heard for the first time [s]: it may have to compile."""

SILENCE = 3.0
STANDSTILL_TIMEOUT = 10.0
_GLANCE = 0.05

Show = Callable[[Snapshot, float | None], None]


@dataclass(frozen=True, slots=True)
class Outcome:
    """How a live run ended: what failed (empty: nothing), whether it was interrupted, how long it drove."""

    failure: str
    interrupted: bool
    duration_s: float


def run_live(
    scenario: Scenario, log_path: Path, endpoint: str, ending: Ending, show: Show, *, apart: bool = False
) -> Outcome:
    """Run a scenario live for its duration, or until the end is asked for, or until a daemon fails.

    The router listens on ``endpoint``, where others may connect too. ``apart``: estimators and controllers
    are processes of their own. The scenario as it is run is put beside the log.
    ``show`` gets the snapshot of the run and the time since the leader set off (None before), some 20 times a
    second. However it ends, the robots are stopped, the log is finished and no process is left.
    """
    folder = log_path.parent
    resolved = folder / "scenario.toml"
    try:
        resolved.write_text(scenario_text(scenario), encoding="utf-8")
    except OSError as error:
        raise UsageError(
            f"--out {folder}: cannot be written ({error.strerror}); give another folder"
        ) from None
    router = open_session(Endpoints(listen=endpoint))
    supervisor = _Supervisor(scenario, resolved, log_path, endpoint, APART if apart else TOGETHER)
    try:
        return supervisor.run(ending, show)
    finally:
        supervisor.close()
        close_session(router)


def processes_of(links: Sequence[Link], daemons: Sequence[str]) -> Iterator[tuple[str, str, tuple[str, ...]]]:
    """Name, daemon, and the followers that it serves, of every process of a run; none named means all."""
    for daemon in daemons:
        count = math.ceil(len(links) / FOLLOWERS_PER_PROCESS.get(daemon, len(links)))
        if count == 1:
            yield daemon, daemon, ()
            continue
        each = math.ceil(len(links) / count)
        for number in range(count):
            share = links[number * each : (number + 1) * each]
            yield f"{daemon}{number + 1}", daemon, tuple(link.follower for link in share)


class _Supervisor:
    def __init__(
        self, scenario: Scenario, resolved: Path, log_path: Path, endpoint: str, daemons: Sequence[str]
    ) -> None:
        self._scenario = scenario
        links = links_of(scenario)
        self._pairs = [link_topics(link) for link in links]
        self._nodes = [name for daemon in daemons for name in node_names(daemon, links)]
        self._session = open_session(Endpoints(connect=endpoint))
        self._wire = Wire(self._session, urgent_topics(scenario), layout_of(scenario), "run")
        self._monitor = RunMonitor(self._session, self._pairs, layout_of(scenario))
        self._children = Children(log_path.parent)
        extra = {
            "recorder": ["--out", str(log_path)],
            "emulator": ["--needs", ",".join(daemon for daemon in daemons if daemon != "emulator")],
        }
        self._drivers: list[str] = []
        for name, daemon, followers in processes_of(links, daemons):
            arguments = [str(resolved), "--connect", endpoint, *extra.get(daemon, [])]
            for follower in followers:
                arguments += ["--follower", follower]
            self._children.start(name, daemon, arguments)
            if daemon in HOSTED:
                self._drivers.append(name)

    def run(self, ending: Ending, show: Show) -> Outcome:
        begun, known = time.monotonic(), 0
        set_off: float | None = None
        failure = ""
        duration = self._scenario.run.duration_s
        while not (ending.asked or failure):
            failure = self._failure(_GLANCE)
            snapshot = self._monitor.update()
            now = time.monotonic()
            if set_off is None and snapshot.motion_since_ns is not None:
                set_off = now - (time.time_ns() - snapshot.motion_since_ns) * 1e-9
            if len(snapshot.heard) > known:
                begun, known = now, len(snapshot.heard)
            if set_off is None and now - begun > START_TIMEOUT:
                failure = (
                    f"the start barrier did not open within {START_TIMEOUT:g} s: {self._waiting(snapshot)}"
                )
            show(snapshot, None if set_off is None else now - set_off)
            if set_off is not None and now - set_off >= duration:
                break
        driven = 0.0 if set_off is None else min(time.monotonic() - set_off, duration)
        self._stop(failure or ("interrupted" if ending.asked else "end of run"))
        return Outcome(failure, ending.asked, driven)

    def close(self) -> None:
        """Who drives robots first, its last word being a standstill; recorder last, to miss nothing."""
        self._children.end(self._drivers)
        self._children.end(["emulator"])
        self._children.end(["recorder"])
        self._children.close()
        self._monitor.close()
        self._wire.close()
        close_session(self._session)

    def _failure(self, timeout: float) -> str:
        """What has gone wrong, if anything, within ``timeout`` [s]."""
        ended = self._children.wait_for_end_of_any(timeout)
        if ended is not None:
            words = ended.last_words()
            code = ended.process.wait()
            how = f"was killed by signal {-code}" if code < 0 else f"ended with exit code {code}"
            return f"the {ended.name} {how}" + (f": {words}" if code > 0 and words else "")
        silent = self._monitor.snapshot.silent(self._nodes, SILENCE)
        return f"the {silent} has said nothing for {SILENCE:g} s" if silent else ""

    def _stop(self, reason: str) -> None:
        """Stop everybody, speak for a controller that may be gone, and wait until the robots stand."""
        self._wire.publish(topics.STOP, encode(msg.String(data=reason)))
        for pair in self._pairs:
            still = drive_message(STANDSTILL, time.time_ns(), pair.follower, stamped=pair.stamped)
            self._wire.publish(pair.cmd_vel, encode(still))
        deadline = time.monotonic() + STANDSTILL_TIMEOUT
        while time.monotonic() < deadline and self._somebody_moves():
            time.sleep(_GLANCE)
        time.sleep(_GLANCE)

    def _somebody_moves(self) -> bool:
        """Whether a robot that was seen has yet to stand; without the emulator none ever will."""
        snapshot = self._monitor.update()
        return bool(snapshot.truths) and not snapshot.standing and self._children.running("emulator")

    def _waiting(self, snapshot: Snapshot) -> str:
        """What the start barrier waits for, in words."""
        unheard = [name for name in self._nodes if name not in snapshot.heard]
        if unheard:
            return f"nothing was heard of {', '.join(unheard)}"
        problems = [f"{name}: {problem}" for name, problem in snapshot.problems.items() if problem]
        return "; ".join(problems) or "no daemon says why"
