"""Configurations of Zenoh sessions: ours laid over what a file says, so that nothing is open by accident."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import zenoh

from hil.wire.role_keys import RoleKeys

_QUEUE = "transport/link/tx/queue"
# By default two urgent messages may wait for a link, and a third is dropped after 1 ms: less than a
# recorder that is flushing its file needs, while a stalled viewer may still hold up nobody for long.
_PATIENT = {
    f"{_QUEUE}/size/real_time": 16,
    f"{_QUEUE}/size/data": 16,
    f"{_QUEUE}/congestion_control/drop/wait_before_drop": 5000,
}
# Who is waited for is asked again; ten seconds for one answer would hold up whoever wants to leave.
_OPEN_MS = 2000
_QUIET: dict[str, Any] = {
    "scouting/multicast/enabled": False,
    "scouting/gossip/enabled": False,
    "listen/endpoints": [],
}
# Who is no client would go on alone where the other end is missing, and say nothing.
_ANSWERED = {"connect/exit_on_failure": True, "connect/timeout_ms": 0}
_ABREAST = "abreast"
_SAYS = "says"


def endpoint_config(connect: str | None, listen: str | None) -> zenoh.Config:
    """Configuration of a session that connects, listens or both; raises :class:`zenoh.ZError`."""
    config = zenoh.Config()
    _set(config, "mode", "router" if listen else "client")
    _lay_over(config, connect, listen)
    return config


def file_config(path: Path) -> zenoh.Config:
    """Configuration by a file. What it leaves out is as of ours: it listens nowhere, and looks for nobody.

    Raises :class:`zenoh.ZError` for what Zenoh refuses.
    """
    config = zenoh.Config.from_file(str(path))
    if _said(config, "mode") is None:
        listens = _differs(config, "listen/endpoints") and _said(config, "listen/endpoints")
        _set(config, "mode", "router" if listens else "client")
    _lay_over(config, None, None)
    return config


def keys_config(keys: RoleKeys, connect: str | None, listen: str | None) -> zenoh.Config:
    """Configuration of a role by the file in its folder of keys; raises :class:`zenoh.ZError`.

    The paths are those of the folder as it lies now, which may have been copied.
    """
    config = zenoh.Config.from_file(str(keys.config))
    _set(config, "transport/link/tls", tls_section(keys))
    _set(config, "connect/endpoints", [])
    _set(config, "listen/endpoints", [])
    _lay_over(config, connect, listen)
    return config


def role_text(keys: RoleKeys, endpoint: str, says: tuple[str, ...], access: dict[str, Any] | None) -> str:
    """Zenoh configuration file of a role, which connects to an endpoint, or listens there with ``access``.

    ``says``: the keys that it may publish on, noted for the role itself: the router tells nobody of refusals.
    """
    side = "connect" if access is None else "listen"
    flat: dict[str, Any] = {
        "mode": "client" if access is None else "router",
        **_QUIET,
        f"{side}/endpoints": [endpoint],
        "transport/link/tls": tls_section(keys),
        **_PATIENT,
        "metadata": {_ABREAST: {"role": keys.role, _SAYS: list(says)}},
    }
    if access is not None:
        flat["access_control"] = access
    return json.dumps(_nested(flat), indent=2) + "\n"


def tls_section(keys: RoleKeys) -> dict[str, object]:
    """Both sides show certificates of the one authority, and the router's is for where it is reached."""
    side = "listen" if keys.role == "router" else "connect"
    return {
        "root_ca_certificate": str(keys.authority.absolute()),
        f"{side}_certificate": str(keys.certificate.absolute()),
        f"{side}_private_key": str(keys.secret.absolute()),
        "enable_mtls": True,
        "verify_name_on_connect": True,
        "close_link_on_expiration": False,
    }


def keys_allowed(keys: RoleKeys) -> frozenset[str]:
    """Key expressions that a role may publish on, as its file notes them; raises :class:`zenoh.ZError`."""
    noted = _said(zenoh.Config.from_file(str(keys.config)), "metadata") or {}
    return frozenset(noted.get(_ABREAST, {}).get(_SAYS, ()))


def connects_to(config: zenoh.Config) -> list[str]:
    """Endpoints that a configuration connects to, empty for none."""
    return _flat(_said(config, "connect/endpoints"))


def listens_at(config: zenoh.Config) -> list[str]:
    """Endpoints where a configuration listens, empty for none."""
    return _flat(_said(config, "listen/endpoints"))


def _lay_over(config: zenoh.Config, connect: str | None, listen: str | None) -> None:
    for key, ours in {**_QUIET, **_PATIENT, "transport/unicast/open_timeout": _OPEN_MS}.items():
        if not _differs(config, key):
            _set(config, key, ours)
    if connect:
        _set(config, "connect/endpoints", [connect])
    if listen:
        _set(config, "listen/endpoints", [listen])
    if listens_at(config) and not _differs(config, "adminspace/enabled"):
        # Whoever is connected can be told from those who take part.
        _set(config, "adminspace/enabled", True)
    if connects_to(config) and _said(config, "mode") != "client":
        for key, answered in _ANSWERED.items():
            if not _differs(config, key):
                _set(config, key, answered)


def _differs(config: zenoh.Config, key: str) -> bool:
    """Whether a configuration says something else than what Zenoh takes where nothing is said."""
    return bool(_said(config, key) != _said(zenoh.Config(), key))


def _said(config: zenoh.Config, key: str) -> Any:
    return json.loads(config.get_json(key))


def _set(config: zenoh.Config, key: str, value: object) -> None:
    config.insert_json5(key, json.dumps(value))


def _flat(endpoints: Any) -> list[str]:
    """Endpoints of all modes of a session: Zenoh takes one list, or one for each mode."""
    if isinstance(endpoints, dict):
        return [each for some in endpoints.values() for each in _flat(some)]
    return [endpoints] if isinstance(endpoints, str) else list(endpoints or ())


def _nested(flat: dict[str, Any]) -> dict[str, Any]:
    """Sections in sections, by keys whose parts are separated by slashes."""
    whole: dict[str, Any] = {}
    for key, value in flat.items():
        *sections, name = key.split("/")
        place = whole
        for section in sections:
            place = place.setdefault(section, {})
        place[name] = value
    return whole
