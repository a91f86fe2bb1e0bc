"""The distribution for machines that only serve a lab: what it needs, and that daemons do without more."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from hil.extras import EXTRA_OF, LEFT_OUT
from hil.wire.session import reserved_endpoint

ROOT = Path(__file__).resolve().parents[2]
OURS, BUILT = (
    tomllib.loads((folder / "pyproject.toml").read_text(encoding="utf-8"))
    for folder in (ROOT, ROOT / "packaging" / "abreast-daemon")
)
WITHOUT = """
import sys
sys.modules.update(dict.fromkeys(sys.argv[1].split(",")))
from hil.command_line import main
main(sys.argv[2:])
"""
MISSING = ",".join([*LEFT_OUT, *EXTRA_OF])


def test_it_is_of_the_same_version_and_needs_the_same_but_for_compiler_and_science() -> None:
    ours, built = OURS["project"], BUILT["project"]
    for key in ("version", "requires-python", "license", "classifiers", "scripts"):
        assert built[key] == ours[key], key
    wanted = [each for each in ours["dependencies"] if re.split(r"[<>=]", each)[0] not in LEFT_OUT]
    assert built["dependencies"] == wanted
    assert built["optional-dependencies"].items() <= ours["optional-dependencies"].items()


def test_it_ships_what_the_wheel_of_abreast_does() -> None:
    held = BUILT["tool"]["hatch"]["build"]["targets"]["wheel"]["force-include"]
    ours = OURS["tool"]["hatch"]["build"]["targets"]["wheel"]
    whole = {name: name for name in ours["packages"]} | ours["force-include"]
    assert {source.removeprefix("../../"): place for source, place in held.items()} == whole


@pytest.mark.parametrize("name", ["emulator", "leader", "follower", "estimator", "controller", "recorder"])
def test_a_daemon_does_without_and_says_once_that_it_is_interpreted(name: str, tmp_path: Path) -> None:
    what = ["--out", str(tmp_path / "log.mcap")] if name == "recorder" else []
    with reserved_endpoint() as endpoint:
        there = ["--listen", endpoint, "--duration", "1.5", *what]
        command = [sys.executable, "-c", WITHOUT, MISSING, name, "turtlebot3", *there]
        done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr
    first, *rest = done.stderr.splitlines()
    assert first == f"abreast {name}: interpreted, as numba is not installed: slower, bit for bit the same"
    assert any("ready" in line for line in rest)
    assert "interpreted" not in "".join(rest)


@pytest.mark.parametrize("name", ["simulate", "run", "replay"])
def test_what_needs_the_rest_says_in_one_line_what_brings_it(name: str, tmp_path: Path) -> None:
    log = [str(tmp_path)] if name == "replay" else []
    command = [sys.executable, "-c", WITHOUT, MISSING, name, *log]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False, cwd=tmp_path)
    assert (done.returncode, done.stderr) == (
        2,
        f"abreast: {name}: needs scipy, which is not installed; "
        "pip install abreast in an environment that has no abreast-daemon\n",
    )
    assert not list(tmp_path.iterdir())
