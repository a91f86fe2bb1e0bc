"""The follower's link to the lab: none, a relay of TCP, or a network namespace with a cable to it."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass

from hil.faults.processes import Processes
from hil.wire.session import reserved_endpoint

_NETS = "10.213"
_PORT = 7447


@dataclass(frozen=True, slots=True)
class Link:
    """Where the lab's router listens, and what the follower's guard is started with.

    ``far``: where the guard finds the router; ``near``: where it listens for its driver; ``before``: what
    goes before its command. ``become``: lets the link be as words say, of :mod:`hil.faults.relay`.
    """

    router: str
    far: str
    near: str
    before: tuple[str, ...]
    become: Callable[[str], None]


class NotHereError(Exception):
    """What a fault takes is not to be had on this machine; the text says what it is."""


@contextmanager
def no_link() -> Iterator[Link]:
    """Router, guard and driver on one machine."""
    with reserved_endpoint() as router, reserved_endpoint() as near:
        yield Link(router, router, near, (), lambda _words: None)


@contextmanager
def relayed(processes: Processes) -> Iterator[Link]:
    """A relay between them."""
    with ExitStack() as held:
        router, near, passing = (held.enter_context(reserved_endpoint()) for _ in range(3))
        ports = [endpoint.rpartition(":")[2] for endpoint in (passing, router)]
        # The relay's own socket wants the port for itself.
        relay = processes.start("relay", "-m", "hil.faults.relay", *ports)

        def become(words: str) -> None:
            assert relay.stdin is not None
            relay.stdin.write(f"{words}\n".encode())
            relay.stdin.flush()

        yield Link(router, passing, near, (), become)


@contextmanager
def cabled() -> Iterator[Link]:
    """A network namespace for the follower; raises :class:`NotHereError` for who may not make one."""
    name = f"abreast-{os.getpid()}"
    lab_net, near_net = _free_nets()
    cable, near = f"ab{os.getpid() % 100000}c", f"ab{os.getpid() % 100000}n"
    inside = ["ip", "-n", name]
    with ExitStack() as held:
        _do(["ip", "netns", "add", name])
        held.callback(_quietly, ["ip", "netns", "del", name])
        for ours, theirs, net in ((cable, "cable", lab_net), (near, "near", near_net)):
            _do(["ip", "link", "add", ours, "type", "veth", "peer", "name", theirs, "netns", name])
            held.callback(_quietly, ["ip", "link", "del", ours])
            _do(["ip", "addr", "add", f"{net}.1/30", "dev", ours])
            _do(["ip", "link", "set", ours, "up"])
            _do([*inside, "addr", "add", f"{net}.2/30", "dev", theirs])
            _do([*inside, "link", "set", theirs, "up"])
        _do([*inside, "link", "set", "lo", "up"])

        def become(words: str) -> None:
            # The robot's end goes down: that of the lab keeps its address.
            _do([*inside, "link", "set", "cable", "down" if words == "freeze" else "up"])

        router = f"tcp/{lab_net}.1:{_PORT}"
        yield Link(router, router, f"tcp/{near_net}.2:{_PORT}", ("ip", "netns", "exec", name), become)


def _free_nets() -> tuple[str, str]:
    """Two networks that no interface here has: of two labs on one machine each is to have its own."""
    told = _do(["ip", "-o", "-4", "addr"])
    # Who looks at the same moment begins elsewhere.
    for step in range(128):
        nets = [f"{_NETS}.{2 * ((os.getpid() + step) % 128) + each}" for each in range(2)]
        if not any(f" {net}." in told for net in nets):
            return nets[0], nets[1]
    raise NotHereError(f"no network within {_NETS} is free here")


def _do(command: Sequence[str]) -> str:
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    except FileNotFoundError:
        raise NotHereError(f"there is no {command[0]} here") from None
    if done.returncode:
        raise NotHereError(f"{' '.join(command)}: {' '.join(done.stderr.split())}")
    return done.stdout


def _quietly(command: Sequence[str]) -> None:
    subprocess.run(command, capture_output=True, check=False)
