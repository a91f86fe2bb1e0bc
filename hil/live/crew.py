"""Who takes part in a live run: its daemons, by what of the lab there is, and what each is started with."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from hil.guard.report import node_of
from hil.scenario.links import STARTERS, Link

FOLLOWERS_PER_PROCESS = {"follower": 32, "estimator": 4}
"""A process in Python keeps up with that many at 120 frames a second."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Crew:
    """What a run brings along.

    ``apart``: estimator and controller of a follower as two processes. ``real``: robots and motion capture
    exist, all but ``emulate``, which is leader, follower or empty. ``by_hand``: a real leader is not driven
    by its program but by somebody else; else it sets off ``countdown_s`` after all are ready, None for what
    is usual. ``guarded``: all robots that are commanded have guards.
    """

    apart: bool = False
    real: bool = False
    emulate: str = ""
    by_hand: bool = False
    countdown_s: float | None = None
    guarded: bool = True

    @property
    def daemons(self) -> tuple[str, ...]:
        """The daemons of the run."""
        hosts = ("estimator", "controller") if self.apart else ("follower",)
        leads = ("leader",) if self.real and self.emulate != "leader" else ()
        emulates = ("emulator",) if not self.real or self.emulate else ()
        return ("recorder", *hosts, *leads, *emulates)

    @property
    def drives_leader(self) -> bool:
        """Whether a daemon of the run drives a real leader."""
        return "leader" in self.daemons and not self.by_hand

    def guards(self, robots: Sequence[str]) -> tuple[str, ...]:
        """Names of the guards on real robots, of all robots by name, the leader first."""
        if not (self.real and self.guarded):
            return ()
        leader, *followers = robots
        real = [*([leader] if self.drives_leader else []), *([] if self.emulate == "follower" else followers)]
        return tuple(map(node_of, real))

    def options(self, daemon: str, log_path: Path, robots: Sequence[str]) -> list[str]:
        """What a daemon is started with, besides the scenario, the wire and the followers that it serves."""
        guarded = [] if self.guarded else ["--no-guard"]
        if daemon == "recorder":
            return ["--out", str(log_path), *guarded]
        if daemon not in STARTERS:
            return guarded
        needed = [*(each for each in self.daemons if each not in STARTERS), *self.guards(robots)]
        options = ["--needs", ",".join(needed), *guarded]
        if daemon == "emulator":
            return options
        if self.by_hand:
            return [*options, "--by-hand"]
        return options if self.countdown_s is None else [*options, "--countdown", str(self.countdown_s)]


TOGETHER, APART = Crew().daemons, Crew(apart=True).daemons
"""The daemons of an emulated run with estimator and controller of a follower in one process, and in two."""


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
