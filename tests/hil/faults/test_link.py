"""Networks of labs that are tried at the same time."""

from __future__ import annotations

import pytest

from hil.faults import link
from hil.faults.link import NotHereError


def test_a_lab_takes_networks_that_no_other_has(monkeypatch: pytest.MonkeyPatch) -> None:
    taken = "1: lo    inet 127.0.0.1/8 scope host lo\n"
    monkeypatch.setattr(link, "_do", lambda _: taken)
    found = set[str]()
    for number in range(128):
        nets = link._free_nets()
        assert not found & set(nets)
        found |= set(nets)
        taken += f"{number}: ab1n    inet {nets[number % 2]}.1/30 scope global ab1n\n"
    with pytest.raises(NotHereError, match=r"no network within 10\.213"):
        link._free_nets()
