"""A live run: a router, its daemons as processes, and a supervisor that stops the robots if one fails.

Followers share a process, and in a long chain there are several of these. With estimators and controllers
apart, the controllers share one, the estimators one for every few of them.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from hil.guard.report import GUARDS
from hil.live.child_processes import Children
from hil.live.crew import Crew, processes_of
from hil.live.daemon import Ending
from hil.live.disk_watch import refuse_full_disk
from hil.live.run_monitor import RunMonitor, Snapshot
from hil.live.runs_here import found_here, own_folder
from hil.log.resolved_scenario import write_resolved
from hil.nodes.findings import named_findings
from hil.nodes.link_nodes import leader_standstill, standstill
from hil.nodes.node import diagnostics
from hil.nodes.stopping import SUPERVISOR, stop_finding
from hil.scenario.links import HOSTED, links_of, node_names
from hil.scenario.schema import Scenario
from hil.wire import message_types as msg
from hil.wire import topics
from hil.wire.key_layout import layout_of
from hil.wire.lab_robots import robots_of
from hil.wire.messages import encode
from hil.wire.outlet import UNSIGNED
from hil.wire.pubsub import Wire
from hil.wire.router_clients import named_suspects
from hil.wire.session import Endpoints, allowed_keys, close_session, open_session
from hil.wire.topics import link_topics, urgent_topics

START_TIMEOUT = 120.0
"""For the start barrier [s], from when the last of all daemons was heard for the first time."""

FIRST_WORD_TIMEOUT = 900.0
"""For a daemon that was never heard [s]: on a busy machine its first start compiles for many minutes."""

SILENCE = 3.0
STANDSTILL_TIMEOUT = 10.0
_GLANCE = 0.05
_LAST_BREATH = 1.0
"""From the stop that a daemon says as it breaks down to its end [s]."""

_ANSWER_S = 0.5
"""For routers to tell who is connected [s]."""

Show = Callable[[Snapshot, float | None], None]


@dataclass(frozen=True, slots=True)
class Outcome:
    """How a live run ended: what failed (empty: nothing), whether it was interrupted, how long it drove.

    ``robots``: in words, what was seen of how the robots were left. ``recorded``: the recorder was heard, so
    that there was a log. ``signal``: what interrupted it. ``stopped``: nothing broke down, somebody said
    stop, as ``failure`` says.
    """

    failure: str
    interrupted: bool
    duration_s: float
    robots: str
    signal: int = 0
    recorded: bool = False
    stopped: bool = False


def run_live(
    scenario: Scenario, log_path: Path, endpoints: Endpoints, ending: Ending, show: Show, crew: Crew
) -> Outcome:
    """Run a scenario live for its duration, or until the end is asked for, or until a daemon fails.

    With ``endpoints`` that listen we are the router, else it is there. Others may connect to it too; real
    robots do. The scenario as it is run is put beside the log.
    ``show`` gets the snapshot of the run and the time since the leader set off (None before), some 20 times a
    second. However it ends, the robots are stopped, the log is finished and no process is left.
    """
    folder = log_path.parent
    refuse_full_disk(folder)
    resolved = write_resolved(scenario, folder)
    with ExitStack() as held:
        if endpoints.listen:
            held.callback(close_session, open_session(endpoints))
        held.enter_context(found_here(endpoints.joining, resolved, own_folder()))
        supervisor = _Supervisor(
            scenario, resolved, log_path, endpoints.joining, crew, give_up=lambda: ending.asked
        )
        held.callback(supervisor.close)
        return supervisor.run(ending, show)


class _Supervisor:
    def __init__(
        self,
        scenario: Scenario,
        resolved: Path,
        log_path: Path,
        joining: Endpoints,
        crew: Crew,
        *,
        give_up: Callable[[], bool] = lambda: False,
    ) -> None:
        self._scenario, self._crew = scenario, crew
        self._links = links_of(scenario)
        pairs = [link_topics(link) for link in self._links]
        self._nodes = [name for daemon in crew.daemons for name in node_names(daemon, self._links)]
        allowed = allowed_keys(joining)
        self._session = open_session(joining, give_up=give_up)
        self._wire = Wire(self._session, urgent_topics(scenario), layout_of(scenario), "run", allowed)
        self._robots = robots_of(scenario)
        names = [robot.name for robot in self._robots]
        self._guards = crew.guards(names)
        self._nodes += self._guards
        self._armed: set[str] = set()
        watched = self._robots[0 if crew.drives_leader else 1 :] if crew.real else ()
        self._wheels = {each.odom: each.name for each in watched}
        self._monitor = RunMonitor(self._session, pairs, layout_of(scenario), tuple(self._wheels))
        self._children = Children()
        self._drivers: list[str] = []
        self._asked_to_stop = False
        for name, daemon, followers in processes_of(self._links, crew.daemons):
            arguments = [str(resolved), *joining.options, *crew.options(daemon, log_path, names)]
            for follower in followers:
                arguments += ["--follower", follower]
            self._children.start(name, daemon, arguments)
            if daemon in HOSTED or daemon == "leader":
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
            self._arm(snapshot)
            if set_off is None and snapshot.motion_since_ns is not None:
                set_off = now - (time.time_ns() - snapshot.motion_since_ns) * 1e-9
            failure = failure or self._stopped(snapshot, None if set_off is None else now - set_off)
            if len(snapshot.heard) > known:
                begun, known = now, len(snapshot.heard)
            patience = START_TIMEOUT if self._all_heard(snapshot) else FIRST_WORD_TIMEOUT
            if set_off is None and not failure and now - begun > patience and not self._may_wait(snapshot):
                failure = (
                    f"the start barrier did not open within {patience:g} s: "
                    f"{snapshot.waits_for(self._nodes) or 'no daemon says why'}"
                )
            show(snapshot, None if set_off is None else now - set_off)
            if set_off is not None and now - set_off >= duration:
                break
        driven = 0.0 if set_off is None else min(time.monotonic() - set_off, duration)
        moving = self._stop(failure or ("interrupted" if ending.asked else "end of run"))
        if moving:
            unseen = f"{', '.join(moving)} {'have' if len(moving) > 1 else 'has'} not been seen to stand"
            unseen += f" within {STANDSTILL_TIMEOUT:g} s; use {'their' if len(moving) > 1 else 'its'} switch"
            failure = f"{failure}; {unseen}" if failure else unseen
        recorded = "recorder" in self._monitor.snapshot.heard
        stopped = self._asked_to_stop and not moving
        return Outcome(failure, ending.asked, driven, self._how_left(), ending.signal, recorded, stopped)

    def close(self) -> None:
        """Who drives robots first, its last word being a standstill; recorder last, to miss nothing."""
        self._children.end(self._drivers)
        self._children.end(["emulator"])
        self._children.end(["recorder"])
        self._children.close()
        self._monitor.close()
        self._wire.close()
        close_session(self._session)

    def _may_wait(self, snapshot: Snapshot) -> bool:
        """Whether what is waited for may take its time: people who set up robots do, daemons do not."""
        return self._crew.real and self._all_heard(snapshot)

    def _all_heard(self, snapshot: Snapshot) -> bool:
        return snapshot.heard.keys() >= set(self._nodes)

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

    def _arm(self, snapshot: Snapshot) -> None:
        """Arm the guards of real robots, once each: who begins a run means to drive them."""
        for name in self._guards:
            if name in snapshot.heard and name not in self._armed:
                self._armed.add(name)
                self._wire.publish(topics.ARM, encode(msg.String(data=name.removeprefix(GUARDS))))

    def _stopped(self, snapshot: Snapshot, driven_s: float | None) -> str:
        """That somebody stopped everybody, or a guard its robot, before the time; empty for neither.

        ``driven_s``: since the leader set off [s], None before.

        A daemon that breaks down says stop with its last breath: then its end is what is wrong. Before the
        leader sets off a guard may yet be armed.
        """
        held = next(iter(snapshot.held.items()), None) if driven_s is not None else None
        if snapshot.stopped is None and held is None:
            return ""
        if failure := self._failure(_LAST_BREATH):
            return failure
        if snapshot.stopped is not None:
            self._asked_to_stop = True
            who, reason = snapshot.stopped_by, snapshot.stopped
            when = "before the leader set off" if driven_s is None else f"after {max(driven_s, 0.0):.1f} s"
        else:
            assert held is not None
            who, reason = held[1].who, f"{held[0]} {held[1].text}"
            when = "before its time"
        if UNSIGNED in who:
            clients = self._wire.clients()
            clients.ask()
            clients.wait(_ANSWER_S)
            who = named_suspects(who, clients.suspects())
        self._tell_who_stopped(who, reason)
        return f"stopped {when}: {reason} (by {who})"

    def _tell_who_stopped(self, who: str, reason: str) -> None:
        """Leave in the log by whom and why the run was stopped, as far as our keys let us."""
        if not self._wire.may_publish(topics.DIAGNOSTICS):
            # Keys of an operator that were made before he might; the robots are to be stopped all the same.
            return
        now_ns = time.time_ns()
        found = named_findings(stop_finding(who, reason))
        report = diagnostics(SUPERVISOR, now_ns, f"stopped by {who}: {reason}", found)
        self._wire.publish(topics.DIAGNOSTICS, encode(report))

    def _stop(self, reason: str) -> list[str]:
        """Stop everybody, speak for drivers that may be gone, and wait until the robots stand.

        Returns the real robots that have told how they move, and not that they stand since.
        """
        snapshot = self._monitor.update()
        heard = set(snapshot.wheels)
        # A robot whose link is gone has said what it said before the stop.
        snapshot.wheels.clear()
        self._wire.publish(topics.STOP, encode(msg.String(data=reason)))
        self._tell_to_stand()
        deadline = time.monotonic() + STANDSTILL_TIMEOUT
        while time.monotonic() < deadline and self._somebody_moves(heard):
            time.sleep(_GLANCE)
            if self._crew.real:
                # What real robots hear may be lost on the way.
                self._tell_to_stand()
        time.sleep(_GLANCE)
        snapshot = self._monitor.update()
        heard |= snapshot.wheels.keys()
        return [
            name for wheels, name in self._wheels.items() if wheels in heard and not snapshot.stands(wheels)
        ]

    def _how_left(self) -> str:
        """How the robots were left, in words: what is not known of each that it stands is not said."""
        snapshot = self._monitor.snapshot
        standing = [name for wheels, name in self._wheels.items() if snapshot.stands(wheels)]
        if len(standing) == len(self._robots) or (not self._crew.real and snapshot.standing):
            return "the robots stand"
        told = "the robots were told to stand"
        return f"{told}, {', '.join(standing)} seen to" if standing else told

    def _tell_to_stand(self) -> None:
        still = [standstill(link, time.time_ns()) for link in self._links]
        if self._crew.drives_leader:
            still.append(leader_standstill(self._scenario, time.time_ns()))
        for message in still:
            # Behind a guard it is the guard that lets a robot stand, by the stop.
            if self._wire.may_publish(message.topic):
                self._wire.publish(message.topic, message.payload)

    def _somebody_moves(self, heard: set[str]) -> bool:
        """Whether a robot that was seen has yet to stand; without the emulator no emulated one ever will.

        ``heard``: the topics of odometry that was heard before the stop.
        """
        snapshot = self._monitor.update()
        if wheels := heard | snapshot.wheels.keys():
            return not all(map(snapshot.stands, wheels))
        return bool(snapshot.truths) and not snapshot.standing and self._children.running("emulator")
