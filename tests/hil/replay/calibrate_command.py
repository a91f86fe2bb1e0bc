"""``abreast calibrate`` as tests call it."""

from __future__ import annotations

import pytest

from hil.command_line import main


def calibrated(capsys: pytest.CaptureFixture[str], *words: object) -> tuple[int, str, str]:
    """Exit code, stdout and stderr of the command with these words."""
    with pytest.raises(SystemExit) as done:
        main(["calibrate", *map(str, words)])
    said = capsys.readouterr()
    assert isinstance(done.value.code, int)
    return done.value.code, said.out, said.err
