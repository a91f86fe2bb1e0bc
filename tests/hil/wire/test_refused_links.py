"""What a router says of those whom it refuses."""

from __future__ import annotations

import pytest

from hil.wire.refused_links import RefusedLinks

LINE = (
    "\x1b[2m2026-11-28T18:38:02.187326Z\x1b[0m \x1b[33m WARN\x1b[0m acc-0 ThreadId(05) "
    "\x1b[2mzenoh_link_tls::unicast\x1b[0m\x1b[2m:\x1b[0m received fatal alert: {why}. "
    "Hint: increase the system open file limit.\n"
)


def test_refusals_are_told_at_once_and_then_now_and_then_with_why_and_how_often() -> None:
    refused = RefusedLinks()
    told = {}
    for at in range(250):
        assert refused.hear(LINE.format(why="UnknownCA" if at % 2 else "DecryptError"))
        if text := refused.told(0.1 * at):
            told[at] = text
    assert list(told) == [0, 100, 200]
    assert told[0].endswith("no certificate of this lab: received fatal alert: DecryptError (times: 1)")
    assert "UnknownCA (times: 50), received fatal alert: DecryptError (times: 50)" in told[100]
    assert refused.told(float("inf")).count("times") == 2
    assert refused.told(float("inf")) == ""


@pytest.mark.parametrize("line", ["", "\n", "WARN zenoh::net::routing: something else", "zenoh_link_tls"])
def test_other_lines_are_no_refusals(line: str) -> None:
    refused = RefusedLinks()
    assert not refused.hear(line)
    assert refused.told(0.0) == ""
