from __future__ import annotations

from pathlib import Path

import pytest

from hil.command_line import main
from hil.wire.session import reserved_endpoint


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["run", "--live", "--lockstep"], "over before it is seen"),
        (["run", "--live-port", "8000"], "give --live too"),
        (["run", "--live-address", "0.0.0.0"], "give --live too"),
        (["run", "--live", "--live-address", "192.0.2.77"], "cannot listen at 192.0.2.77"),
        (["live", "--live-port", "70000"], "--live-port"),
        (["live", "no-such-scenario"], "no-such-scenario"),
    ],
)
def test_what_cannot_be_shown_is_said_in_a_line(
    arguments: list[str],
    words: str,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    said = capsys.readouterr()
    assert (ended.value.code, said.out) == (2, "")
    assert words in said.err
    assert said.err.count("\n") == 1


def test_without_a_router_there_is_nothing_to_show(capsys: pytest.CaptureFixture[str]) -> None:
    with reserved_endpoint() as endpoint, pytest.raises(SystemExit) as ended:
        main(["live", "--connect", endpoint])
    assert ended.value.code == 1
    assert "is the router up" in capsys.readouterr().err
