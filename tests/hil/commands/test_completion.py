"""What a shell is told: names, options, keys; and by bash itself."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from hil.command_line import main

FUNCTION = """
. ./abreast.bash
completed() {
    COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); COMPREPLY=()
    _abreast_completion ./abreast 2> /dev/null
    echo "${COMPREPLY[*]}"
}
"""


@pytest.fixture
def script(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Path:
    """A bash script that knows ``completed WORDS``, beside a scenario of one's own."""
    with pytest.raises(SystemExit) as left:
        main(["completion", "bash"])
    assert left.value.code == 0
    (tmp_path / "abreast.bash").write_text(capsys.readouterr().out)
    (tmp_path / "my_lab.toml").write_text('base = "turtlebot3"\n')
    path = tmp_path / "ask.bash"
    path.write_text(FUNCTION)
    called = tmp_path / "abreast"
    called.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m hil "$@"\n')
    called.chmod(0o755)
    return path


CASES = {
    "abreast rec": "recover recorder",
    "abreast run --se": "--seed --secure --set",
    "abreast run tur": "turtlebot3",
    "abreast run my": "my_lab.toml",
    "abreast import c": "csv",
    "abreast scenario show fig2": "fig2-ideal fig2-independent",
    "abreast run --estimator u": "ukf ukf-filterpy",
    "abreast sweep --estimators ekf,mh": "ekf,mhe",
    "abreast simulate --law fe": "feedforward",
    "abreast run --set moc": "mocap.",
    "abreast run --set mocap.lo": "mocap.loss=",
    "abreast run --set estimator.kind = im": "imm",
    "abreast run --set mocap.loss = 0.1 --lock": "--lockstep",
    "abreast run --emulate = l": "leader",
    "abreast bridge natnet --up ''": "y z",
}


def test_bash_completes_names_options_and_keys(script: Path) -> None:
    with script.open("a") as asked:
        asked.writelines(f"completed {words}\n" for words in CASES)
    found = subprocess.run(
        ["bash", "--norc", str(script)], cwd=script.parent, capture_output=True, text=True, check=True
    )
    assert dict(zip(CASES, found.stdout.splitlines(), strict=True)) == CASES


@pytest.mark.parametrize("shell", ["zsh", "fish"])
def test_other_shells_are_told_the_same(shell: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as left:
        main(["completion", shell])
    assert left.value.code == 0
    assert f"_ABREAST_COMPLETE={shell}_complete" in capsys.readouterr().out
    words = {"zsh": ("abreast run --set mocap.lo", "3"), "fish": ("abreast run --set mocap.lo", "mocap.lo")}
    line, place = words[shell]
    asked = {"COMP_WORDS": line, "COMP_CWORD": place, "_ABREAST_COMPLETE": f"{shell}_complete"}
    done = subprocess.run(
        [sys.executable, "-m", "hil"], env=os.environ | asked, capture_output=True, text=True, check=False
    )
    assert "mocap.loss=" in done.stdout


def test_nothing_heavy_is_loaded_to_complete() -> None:
    asked = {
        "COMP_WORDS": "abreast run --set mocap.lo",
        "COMP_CWORD": "3",
        "_ABREAST_COMPLETE": "bash_complete",
    }
    source = (
        "import sys\nfrom hil.command_line import main\n"
        "try:\n    main([])\nexcept SystemExit:\n    pass\n"
        "heavy = {'numba', 'scipy', 'zenoh', 'rosbags', 'matplotlib', 'bokeh', 'rich', 'pyarrow'}\n"
        "assert not heavy & sys.modules.keys(), heavy & sys.modules.keys()\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", source], env=os.environ | asked, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout) == (0, "plain,mocap.loss=\n"), done.stderr
