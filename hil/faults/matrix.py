"""All faults: every role by every signal, links, strangers, floods, clocks, sensors, disk and CPU."""

from __future__ import annotations

import signal
from collections.abc import Iterator, Mapping

from hil.faults.fault import (
    Expected,
    Fault,
    FullDisk,
    LinkFault,
    Nothing,
    SecondFollower,
    Setting,
    Signal,
    Since,
    Starvation,
    Stranger,
)

SIGNALS = {
    "kill": signal.SIGKILL,
    "stop": signal.SIGSTOP,
    "term": signal.SIGTERM,
    "hup": signal.SIGHUP,
}
"""Modes of a process's fault; a frozen one goes on after :data:`FROZEN_S`."""

FROZEN_S = 5.0
ROLES = ("follower", "estimator", "controller", "recorder", "leader", "supervisor", "guard")
"""Whose processes are ended and frozen; the supervisor is the router, by hand ``abreast router`` is."""

CUTS_S = (0.2, 1.0, 5.0, 15.0)
_BOTH: Mapping[str, Since] = {"leader": "fault", "follower": "fault"}
_STOPPED: Mapping[str, Since] = {"leader": "stop", "follower": "stop"}
_NOTICED: Mapping[str, Since] = {"leader": "stop", "follower": "fault"}
_OWN: Mapping[str, Mapping[str, Since]] = {
    "follower": {"follower": "fault"},
    "estimator": {"follower": "fault"},
    "controller": {"follower": "fault"},
    "leader": {"leader": "fault"},
    "supervisor": _BOTH,
    "recorder": {},
    "guard": {"follower": "fault"},
}
"""Who is to stand at once for want of a role."""

_GUARD = "a guard that is gone or frozen leaves its driver at its last command until it is started anew"
_LATCHED = ("latched (", "has said nothing")
_SHORT, _AT_S, _LASTS_S = 8.0, 3.0, 1.0
"""How long a run with a fault of a sensor takes, when that comes and how long it lasts [s]."""


def faults() -> tuple[Fault, ...]:
    """All cases, in the order in which they are tried."""
    return (*_processes(), *_links(), *_strangers(), *_floods(), *_clocks(), *_sensors(), *_machine())


def _processes() -> Iterator[Fault]:
    for how in ("run", "hand"):
        for role in ROLES:
            for mode, number in SIGNALS.items():
                apart = role in ("estimator", "controller")
                target = "guard-follower" if role == "guard" else role
                held = FROZEN_S if mode == "stop" else 0.0
                setting = Setting(how="run" if how == "run" else "hand", apart=apart)
                expected = _by_run(role, mode) if how == "run" else _by_hand(role, mode)
                uncovered = _GUARD if role == "guard" and mode in ("kill", "stop") else ""
                name = f"{mode}-{role}-{'run' if how == 'run' else 'by-hand'}"
                yield Fault(name, role, mode, setting, Signal(target, number, held), expected, uncovered)


def _by_run(role: str, mode: str) -> Expected:
    """By a supervisor, who stops everybody for the fault of anybody and says why."""
    stands = {**_STOPPED, **_OWN[role]}
    if role == "supervisor":
        codes = (-signal.SIGKILL,) if mode == "kill" else (1,)
        words = {"kill": ("latched (",), "stop": _LATCHED}.get(mode, ("interrupted after",))
        return Expected(stands, codes=codes, words=words)
    words = {
        "kill": (f"the {role} was killed by signal 9",),
        "stop": (f"the {role} has said nothing", "latched ("),
    }.get(mode, (f"the {role} ended with exit code 0", f"the {role} ended"))
    if role == "guard":
        words = ("guard/follower has said nothing", "the guard ended", "latched (")
    return Expected(stands, words=words)


def _by_hand(role: str, mode: str) -> Expected:
    """By hand, where guards alone make robots stand."""
    ended = {"kill": -signal.SIGKILL}.get(mode, 0)
    # A guard that is frozen finds, once it goes on, how old everything is.
    silent = role in ("recorder", "estimator") or (role == "guard" and mode != "stop")
    words = () if silent else ("latched (",)
    if role == "estimator":
        # Whose controller stays alive stands for want of estimates, and may go on when they come.
        return Expected(_OWN[role], for_good=mode != "stop", codes=(ended,))
    return Expected(_OWN[role], codes=(ended,), words=words)


def _links() -> Iterator[Fault]:
    for link in ("netns", "relay"):
        setting = Setting(link="netns" if link == "netns" else "relay", duration_s=10.0)
        for cut_s in CUTS_S:
            yield Fault(
                f"cut-{cut_s:g}s-{link}", "link", "cut", setting, LinkFault("freeze", cut_s), _cut(cut_s)
            )
    relayed = Setting(link="relay", duration_s=10.0)
    held: Mapping[str, Since] = {"follower": "fault"}
    for mode, words, stands in (
        ("delay", "delay 1.0", held),
        ("jitter", "jitter 0.1", {}),
        ("rate", "rate 4000", held),
    ):
        after = Expected(stands, codes=(0, 1))
        yield Fault(f"{mode}-relay", "link", mode, relayed, LinkFault(words, 4.0), after)


def _cut(cut_s: float) -> Expected:
    """A short one is a gap; the guard latches after a second of silence, which the run notices."""
    if cut_s < 1.0:
        return Expected({"follower": "fault"}, for_good=False, codes=(0,))
    return Expected({"follower": "fault", "leader": "stop"}, words=_LATCHED)


def _strangers() -> Iterator[Fault]:
    setting = Setting(duration_s=15.0)
    after = Expected(_NOTICED, words=("second sender",))
    # Once: past the guard each command is a fault of its own.
    for kind, for_s in (("forged-wanted", 0.0), ("forged-told", 0.0), ("second-controller", 2.0)):
        yield Fault(kind, "stranger", kind, setting, Stranger(kind, for_s, 50.0), after)
    stopped = Expected(_BOTH, words=("a stranger says so",))
    yield Fault("stranger-stop", "stranger", "stop", setting, Stranger("stop", 0.0, 1.0), stopped)
    second = Expected(_STOPPED, words=("second sender", "sends commands as well"))
    longer = Setting(duration_s=40.0)
    yield Fault("second-follower", "stranger", "second-follower", longer, SecondFollower(), second)


def _floods() -> Iterator[Fault]:
    setting = Setting(duration_s=10.0)
    for kind in ("odometry", "frames", "commands"):
        commands = kind == "commands"
        after = Expected(_NOTICED, words=("second sender",)) if commands else Expected(_STOPPED, codes=(0, 1))
        act = Stranger(f"flood-{kind}", 4.0, 10_000.0)
        yield Fault(f"flood-{kind}", "stranger", f"flood-{kind}", setting, act, after)


def _clocks() -> Iterator[Fault]:
    for off_s in (-0.1, 0.1, -3600.0, 3600.0):
        # A tenth behind is within what a command may be old; its sender is asked for the time all the same.
        setting = Setting(how="hand", clock_s=off_s, drives=False)
        after = Expected({"follower": "fault"}, words=("sender's clock is",))
        yield Fault(f"clock-{off_s:+g}s", "follower", "clock", setting, Nothing(12.0), after)
    jump = ("--set", "mocap.clock_jump_s=10.0", "--set", f"mocap.clock_jump_at_s={_AT_S}")
    setting = Setting(how="emulated", duration_s=_SHORT, options=jump)
    stands = Expected({"follower": "fault"}, codes=(0,))
    yield Fault("mocap-clock-jump", "mocap", "clock_jump", setting, Nothing(_SHORT, _AT_S), stands)


def _to_its_end() -> Expected:
    return Expected({"follower": "stop"}, codes=(0,))


def _sensors() -> Iterator[Fault]:
    for kind in ("step", "turn", "swap", "freeze", "dropout"):
        told = f'mocap.faults=[{{kind="{kind}", at_s={_AT_S}, duration_s={_LASTS_S}'
        told += {"step": ", offset=[0.3, 0.2]", "turn": ", angle=1.0"}.get(kind, "") + "}]"
        setting = Setting(how="emulated", duration_s=_SHORT, options=("--set", told))
        # Which way the leader's body looks is used for nothing: what turns it stops nobody.
        believed = kind == "turn"
        stands = _to_its_end() if believed else Expected({"follower": "fault"}, for_good=False, codes=(0,))
        act = Nothing(_SHORT) if believed else Nothing(_SHORT, _AT_S, _LASTS_S)
        yield Fault(f"mocap-{kind}", "mocap", kind, setting, act, stands)
    for kind in ("silent", "nan", "scale", "delay", "reset"):
        told = f'robot.odometry_faults=[{{kind="{kind}", at_s={_AT_S}, duration_s={_LASTS_S}}}]'
        setting = Setting(how="emulated", duration_s=_SHORT, options=("--set", told))
        yield Fault(f"odometry-{kind}", "odometry", kind, setting, Nothing(_SHORT), _to_its_end())


def _machine() -> Iterator[Fault]:
    full = Expected(_STOPPED, words=("free on", "No space", "disk"))
    setting = Setting(disk_mb=24, duration_s=15.0)
    yield Fault("full-disk", "recorder", "full-disk", setting, FullDisk(), full)
    starved = Expected(_STOPPED, codes=(0, 1))
    yield Fault("starved-cpu", "machine", "cpu", Setting(duration_s=10.0), Starvation(5.0), starved)
