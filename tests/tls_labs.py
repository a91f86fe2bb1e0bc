"""A lab with keys for tests: a folder of them, its router, and sessions of its roles."""

from __future__ import annotations

import datetime
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import zenoh

from hil.live.tls_keys import Deployment, make_keys
from hil.scenario.files import load_scenario
from hil.scenario.guarded import with_guards
from hil.scenario.schema import Scenario
from hil.wire.key_layout import layout_of
from hil.wire.pubsub import Wire
from hil.wire.role_keys import RoleKeys
from hil.wire.roles import ROUTER, Role
from hil.wire.session import Endpoints, allowed_keys, close_session, open_session, reserved_endpoint

NOW = datetime.datetime.now(datetime.UTC)
PATIENCE = 60.0


def lab_keys(folder: Path, *overrides: str, guarded: bool = True) -> Scenario:
    """Make keys for a scenario, and give it."""
    scenario = with_guards(load_scenario("turtlebot3", overrides), present=guarded)
    make_keys(folder, Deployment(scenario), now=NOW)
    return scenario


class TlsLab:
    """A router with keys; ``endpoint``: where it listens."""

    def __init__(self, folder: Path, endpoint: str, held: ExitStack) -> None:
        self.folder, self.endpoint, self._held = folder, endpoint, held

    def session(self, role: Role, folder: Path | None = None) -> zenoh.Session:
        """A session of a role, by the lab's keys or by those of another folder."""
        keys = RoleKeys(folder or self.folder, role)
        session = open_session(Endpoints(connect=self.endpoint, keys=keys), patience=PATIENCE)
        self._held.callback(close_session, session)
        return session

    def wire(self, role: Role, scenario: Scenario, *, strict: bool = True) -> Wire:
        """A wire of a role; one that is not ``strict`` tries to publish what its keys do not allow."""
        keys = RoleKeys(self.folder, role)
        allowed = allowed_keys(Endpoints(connect=self.endpoint, keys=keys)) if strict else None
        wire = Wire(self.session(role), layout=layout_of(scenario), node=role, allowed=allowed)
        self._held.callback(wire.close)
        return wire


@contextmanager
def tls_lab(folder: Path) -> Iterator[TlsLab]:
    """A lab with the keys of a folder, for as long as the block lasts."""
    with ExitStack() as held:
        with reserved_endpoint("tls") as endpoint:
            router = open_session(Endpoints(listen=endpoint, keys=RoleKeys(folder, ROUTER)))
        held.callback(close_session, router)
        yield TlsLab(folder, endpoint, held)
