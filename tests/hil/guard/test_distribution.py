"""The guard for a robot that has no more than Python and Zenoh: what it is made of, and that it works."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from hil import __version__
from hil.guard.order_of import guard_order
from hil.scenario.files import load_scenario
from tests.hil.guard.guarded_lab import PATIENCE, guarded_lab

ROOT = Path(__file__).resolve().parents[3]
FOLDER = ROOT / "packaging" / "abreast-guard"
BUILT = tomllib.loads((FOLDER / "pyproject.toml").read_text(encoding="utf-8"))
SHIPPED = {
    place.removesuffix(".py").replace("/", ".").removesuffix(".__init__")
    for place in BUILT["tool"]["hatch"]["build"]["targets"]["wheel"]["force-include"].values()
}
HOUSE = ("formation", "controllers", "estimation", "hil", "abreast")
LOADS = """
import importlib, json, re, sys, time
began = time.process_time()
for name in sys.argv[1].split(","):
    importlib.import_module(name)
from pathlib import Path
from hil.guard.driver import WireDriver
from hil.guard.order import read_order
from hil.guard.robot_shell import RobotShell
from hil.wire.session import Endpoints, close_session, open_session, reserved_endpoint
with reserved_endpoint() as endpoint:
    session, order = open_session(Endpoints(listen=endpoint)), read_order(Path(sys.argv[2]))
    shell = RobotShell(session, order, WireDriver(session, order))
spent = time.process_time() - began
shell.report()
shell.close()
close_session(session)
files = {name: str(getattr(module, "__file__", None) or "") for name, module in sys.modules.items()}
standard = sys.stdlib_module_names
print(json.dumps({
    "ours": sorted(name for name in files if name.split(".")[0] in sys.argv[3].split(",")),
    "foreign": sorted({name.split(".")[0] for name in files} - set(standard) - {"__main__"}),
    "memory_mb": int(re.search(r"VmHWM:\\s+(\\d+)", Path("/proc/self/status").read_text())[1]) / 1024,
    "cpu_s": spent,
}))
"""


def test_it_ships_what_it_loads_and_loads_nothing_foreign_but_zenoh(tmp_path: Path) -> None:
    path = tmp_path / "order.json"
    path.write_text(guard_order(load_scenario("turtlebot3"), "follower").as_text(), encoding="utf-8")
    command = [sys.executable, "-c", LOADS, ",".join(sorted(SHIPPED)), str(path), ",".join(HOUSE)]
    loaded = json.loads(subprocess.run(command, capture_output=True, text=True, check=True).stdout)
    assert set(loaded["ours"]) == SHIPPED
    assert {name for name in loaded["foreign"] if not name.startswith(("_", "sitecustomize"))} <= {
        "zenoh", "formation", "controllers", "hil", "distutils-precedence",
    }  # fmt: skip
    assert loaded["memory_mb"] < 60.0


def test_it_is_of_the_same_version_and_needs_zenoh_alone() -> None:
    project = BUILT["project"]
    ours = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert project["version"] == ours["version"] == __version__
    assert project["dependencies"] == [each for each in ours["dependencies"] if "zenoh" in each]
    assert project["requires-python"] == ">=3.10"


def oldest_python() -> str:
    """The oldest Python from 3.10 on that this machine has, on PATH or under pyenv."""
    roots = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv")) / "versions"
    for minor in range(10, 30):
        for place in (*roots.glob(f"3.{minor}.*/bin/python3.{minor}"), Path(f"/usr/bin/python3.{minor}")):
            if place.exists() and subprocess.run([place, "-c", ""], check=False).returncode == 0:
                return str(place)
    return sys.executable


@pytest.mark.slow
def test_it_guards_a_robot_from_an_environment_of_its_own(tmp_path: Path) -> None:
    build = [sys.executable, "-m", "hatchling", "build", "--target", "wheel", "--directory", str(tmp_path)]
    subprocess.run(build, cwd=FOLDER, check=True, capture_output=True)
    (wheel,) = tmp_path.glob("*.whl")
    subprocess.run([oldest_python(), "-m", "venv", str(tmp_path / "venv")], check=True)
    there = tmp_path / "venv" / "bin"
    install = [
        str(there / "python"),
        "-m",
        "pip",
        "install",
        "--quiet",
        "--disable-pip-version-check",
        str(wheel),
    ]
    subprocess.run(install, check=True, capture_output=True)
    path = tmp_path / "order.json"
    path.write_text(guard_order(load_scenario("turtlebot3"), "follower").as_text(), encoding="utf-8")
    alone = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    with guarded_lab() as lab:
        command = [str(there / "abreast-guard"), str(path), "--connect", lab.endpoint]
        guard = subprocess.Popen(command, cwd=tmp_path, env=alone, stderr=subprocess.PIPE, text=True)
        try:
            lab.until(lambda: "follower" in lab.guards.held)
            commander = lab.commander()
            lab.until(lab.drives)
            commander.kill()
            lab.stands_soon()
            lab.arm()
            lab.commander()
            lab.until(lab.drives)
            guard.terminate()
            _, words = guard.communicate(timeout=PATIENCE)
            assert (guard.returncode, "ready" in words) == (0, True)
            lab.stands_soon()
        finally:
            guard.kill()
            guard.wait()
