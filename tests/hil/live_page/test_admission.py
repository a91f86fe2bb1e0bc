from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.live_page.admission import Admission


def admission() -> Admission:
    return Admission("t" * 20, names=("Lab-PC", "lab-pc.local"))


@pytest.mark.parametrize(
    "host", ["127.0.0.1:7480", "localhost:9000", "[::1]:7480", "192.0.2.7:80", "lab-pc:7480", "lab-pc.local"]
)
def test_our_own_names_are_let_in(host: str) -> None:
    assert admission().admits_host(host)


@pytest.mark.parametrize(
    "host",
    ["", "evil.example", "evil.example:7480", "localhost.evil.example", "127.0.0.1.evil.example", "[::1"],
)
def test_a_name_that_was_made_to_lead_here_is_refused_and_counted(host: str) -> None:
    found = admission()
    assert not found.admits_host(host)
    assert found.refused == {"host": 1}


def test_only_a_page_of_ours_is_the_origin() -> None:
    found = admission()
    assert found.admits_origin("http://127.0.0.1:7480", "127.0.0.1:7480")
    for origin in (None, "null", "http://127.0.0.1:7481", "http://evil.example", "file://", "http://[::1"):
        assert not found.admits_origin(origin, "127.0.0.1:7480")
    assert found.refused == {"origin": 6}


@given(st.text())
def test_no_other_token_is_ours(token: str) -> None:
    assert admission().admits_token(token) == (token == "t" * 20)


@given(st.text(), st.text())
def test_no_header_disturbs(origin: str, host: str) -> None:
    found = admission()
    found.admits_host(host)
    found.admits_origin(origin, host)
