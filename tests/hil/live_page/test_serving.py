from __future__ import annotations

import socket
from pathlib import Path

import pytest

from hil.errors import UsageError
from hil.live_page.serving import TOKEN_VARIABLE, USUAL_PORT, address_of, bound, is_open, new_token
from hil.wire.role_keys import RoleKeys
from hil.wire.session import Endpoints


def test_a_port_that_is_asked_for_and_taken_is_named_and_the_usual_one_is_given_up() -> None:
    with bound("127.0.0.1", None) as first, bound("127.0.0.1", None) as second:
        taken = first.getsockname()[1]
        assert second.getsockname()[1] not in (taken, USUAL_PORT)
        with pytest.raises(UsageError, match=f"port {taken} .*give another --live-port"):
            bound("127.0.0.1", taken)


@pytest.mark.parametrize("address", ["192.0.2.77", "no.such.name.invalid"])
def test_an_address_that_is_not_ours_is_one_line(address: str) -> None:
    with pytest.raises(UsageError, match=address):
        bound(address, 0)


def test_the_address_has_the_token_behind_a_hash_and_a_place_that_others_reach() -> None:
    with bound("127.0.0.1", 0) as here, bound("0.0.0.0", 0) as everywhere:
        port = here.getsockname()[1]
        assert address_of(here, "") == f"http://127.0.0.1:{port}/"
        assert address_of(here, "secret") == f"http://127.0.0.1:{port}/#secret"
        assert "0.0.0.0" not in address_of(everywhere, "secret")


def test_an_address_of_the_sixth_version_is_bracketed() -> None:
    try:
        listening = bound("::1", 0)
    except UsageError:
        pytest.skip("this machine has no such address")
    with listening:
        assert address_of(listening, "").startswith("http://[::1]:")


def test_only_a_loopback_page_of_a_wire_without_keys_needs_no_token(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(RoleKeys, "check", lambda _: None)
    open_wire = Endpoints(connect="tcp/127.0.0.1:7447")
    keyed = Endpoints(connect="tls/127.0.0.1:7447", keys=RoleKeys(tmp_path, "operator"))
    with bound("127.0.0.1", 0) as here, bound("0.0.0.0", 0) as everywhere:
        assert is_open(here, open_wire)
        assert not is_open(here, keyed)
        assert not is_open(everywhere, open_wire)


def test_a_token_is_random_or_as_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(TOKEN_VARIABLE, raising=False)
    assert new_token() != new_token()
    assert len(new_token()) >= 20
    monkeypatch.setenv(TOKEN_VARIABLE, "0123456789abcdef")
    assert new_token() == "0123456789abcdef"


@pytest.mark.parametrize("token", ["abc", "x" * 257, "0123456789 abcdef", "0123456789#abcdef", "ä" * 20])
def test_a_token_that_is_short_or_that_an_address_cannot_bear_is_refused(
    token: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(TOKEN_VARIABLE, token)
    with pytest.raises(UsageError, match=f"{TOKEN_VARIABLE} has {len(token)} characters, expected 16 to 256"):
        new_token()


def test_a_socket_handed_on_is_the_same_place() -> None:
    with bound("127.0.0.1", 0) as here:
        again = socket.socket(fileno=here.dup().detach())
        with again:
            assert again.getsockname() == here.getsockname()
