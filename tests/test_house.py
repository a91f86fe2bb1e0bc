"""The rules that the house is built by: who imports whom, what is pure, what is shipped."""

from __future__ import annotations

import ast
import graphlib
import re
import tomllib
import zipfile
from pathlib import Path

import pytest
from hatchling.builders.wheel import WheelBuilder

import hil
from hil.errors import UsageError
from hil.recordings.column_map import load_column_map
from hil.replay.topic_map import load_topic_map
from hil.scenario.files import load_scenario, scenario_names

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = {
    "formation": {"formation"},
    "controllers": {"controllers", "formation"},
    "estimation": {"estimation", "formation"},
    "hil": {"hil", "controllers", "estimation", "formation"},
    "abreast": {"abreast", "hil", "controllers", "estimation", "formation"},
}
"""Packages, and those of them that each may import."""

ROOMS = {
    "estimation": (
        "models", "own_motion", "time", "filters", "tracking", "bounds", "consistency", "calibration",
    ),
    "hil": (
        "extensions", "scenario", "wire", "guard", "log", "nodes", "emulator", "lockstep", "live", "scene",
        "bridge", "doctor", "replay", "recordings", "judge", "exports", "figures", "reports", "live_page",
        "sweep", "compare", "simulate", "faults", "soak", "commands",
    ),
}  # fmt: skip
"""Rooms of the packages that have some, lower ones first: each may import those before it."""

HALL = {"estimation": set[str](), "hil": {"__main__", "command_line", "errors", "extras"}}
"""What lies outside all rooms of a package, besides its ``__init__``."""

FROM_HALL = {"hil", "hil.errors", "hil.extras"}
"""What the rooms may import from there."""

COMMAND = "hil/__main__.py"
"""What alone goes through the door from inside: it is the console script under another name."""

PURE = ("formation", "controllers", "estimation")
WORLDLY = {
    "asyncio", "datetime", "io", "logging", "mcap", "msgspec", "multiprocessing", "os", "pathlib", "random",
    "rosbags", "shutil", "socket", "subprocess", "sys", "tempfile", "threading", "time", "zenoh",
}  # fmt: skip
"""What no pure package may import: clocks, files, wires, processes, hidden randomness."""

COMPILER = {"formation/kernel.py", "formation/compile_cache.py"}
"""What may look at files and the environment all the same: where compiled code is kept."""

COMPILES = {
    "formation/compiler.py", "formation/compiled_records.py", "formation/compile_cache.py",
    "formation/kernel_linking.py", "formation/compiled_calls.py",
}  # fmt: skip
"""What alone may import numba: all else is plain Python, which runs without it."""

NAMELESS = {"common", "helper", "helpers", "manager", "misc", "util", "utils"}
LONGEST_MODULE = 400

MODULES = sorted(path for package in PACKAGES for path in (ROOT / package).rglob("*.py"))
MAPS = sorted((ROOT / "data" / "maps").glob("*.toml"))


def imported(path: Path) -> set[str]:
    """Top-level names of all that a module imports, wherever in it."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name.partition(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            names.add((node.module or "").partition(".")[0])
    return names


def modules_imported(source: str) -> set[str]:
    """Modules of the packages that a source imports, wherever in it, by their dotted names."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            whole = {f"{node.module}.{alias.name}" for alias in node.names}
            found |= {name if name in NAMES else str(node.module) for name in whole}
    return found & NAMES


def dotted(path: Path) -> str:
    return ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")


NAMES = {dotted(path) for path in MODULES}


def called(path: Path) -> set[str]:
    """Plain names that a module calls."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    calls = (node.func for node in ast.walk(tree) if isinstance(node, ast.Call))
    return {function.id for function in calls if isinstance(function, ast.Name)}


def named(path: Path) -> str:
    return str(path.relative_to(ROOT))


@pytest.mark.parametrize("path", MODULES, ids=named)
def test_a_module_keeps_to_its_floor(path: Path) -> None:
    package = path.relative_to(ROOT).parts[0]
    used = imported(path)
    allowed = PACKAGES["abreast"] if named(path) == COMMAND else PACKAGES[package]
    assert used & PACKAGES.keys() <= allowed
    assert "tests" not in used
    if package in PURE and named(path) not in COMPILER:
        assert not used & WORLDLY
        assert not called(path) & {"open", "print", "input", "exec", "eval", "__import__"}
    assert not used & {"numba", "llvmlite"} or named(path) in COMPILES
    assert len(path.read_text(encoding="utf-8").splitlines()) <= LONGEST_MODULE
    assert not set(path.stem.split("_")) & NAMELESS


def room_of(name: str) -> str:
    return name.split(".")[1] if "." in name else ""


def misplaced(name: str, source: str) -> set[str]:
    """What a module imports from a room above its own, or from outside the rooms without leave."""
    package, room = name.partition(".")[0], room_of(name)
    if room not in ROOMS[package]:
        return set()
    below = set(ROOMS[package][: ROOMS[package].index(room) + 1])
    within = {other for other in modules_imported(source) if other.partition(".")[0] == package}
    return {other for other in within - FROM_HALL if room_of(other) not in below}


@pytest.mark.parametrize(
    "path", [path for path in MODULES if dotted(path).partition(".")[0] in ROOMS], ids=named
)
def test_a_module_keeps_to_its_room(path: Path) -> None:
    assert not misplaced(dotted(path), path.read_text(encoding="utf-8"))


@pytest.mark.parametrize(
    ("name", "source"),
    [
        ("hil.wire.topics", "import hil.log.reader"),
        ("hil.wire.topics", "def late() -> None:\n    from hil.log import reader"),
        ("hil.log.reader", "from hil.command_line import main"),
        ("estimation.models.motion", "from estimation.filters.belief import Belief"),
    ],
)
def test_an_import_from_above_is_found(name: str, source: str) -> None:
    assert misplaced(name, source)


def test_nothing_lies_outside_the_rooms() -> None:
    for package, rooms in ROOMS.items():
        parts = [
            path.relative_to(ROOT / package).parts for path in MODULES if path.is_relative_to(ROOT / package)
        ]
        assert {part for part, *inner in parts if inner} == set(rooms)
        assert {part for part, *inner in parts if not inner} == {
            f"{name}.py" for name in HALL[package] | {"__init__"}
        }


def test_no_module_imports_itself_by_way_of_others() -> None:
    graph = {dotted(path): modules_imported(path.read_text(encoding="utf-8")) for path in MODULES}
    graphlib.TopologicalSorter(graph).prepare()
    with pytest.raises(graphlib.CycleError):
        graphlib.TopologicalSorter(graph | {"hil.errors": {"hil.command_line"}}).prepare()


def test_there_are_no_other_packages() -> None:
    apart = {"tests", "benchmarks"}
    assert {path.parent.name for path in ROOT.glob("*/__init__.py")} - apart == PACKAGES.keys()


@pytest.mark.parametrize("name", scenario_names())
def test_every_shipped_scenario_loads_and_is_described(name: str) -> None:
    scenario = load_scenario(name)
    assert scenario.name == name
    assert scenario.description


@pytest.mark.parametrize("path", MAPS, ids=named)
def test_every_shipped_map_is_one(path: Path) -> None:
    loaded = []
    for load in (load_column_map, load_topic_map):
        try:
            loaded.append(load(path.stem))
        except UsageError:
            continue
    assert len(loaded) == 1


def test_every_test_that_the_docs_name_is_there() -> None:
    text = "".join(path.read_text(encoding="utf-8") for path in sorted((ROOT / "docs").glob("*.md")))
    named_tests = re.findall(r"`(tests/[\w/]+\.py)(?:::(\w+))?`", text)
    assert named_tests
    for path, name in named_tests:
        assert f"def {name}" in (ROOT / path).read_text(encoding="utf-8"), (path, name)


def project() -> dict[str, dict[str, str]]:
    with (ROOT / "pyproject.toml").open("rb") as file:
        return tomllib.load(file)


def test_the_version_is_the_same_everywhere() -> None:
    assert hil.__version__ == project()["project"]["version"]


def test_the_wheel_holds_the_packages_the_scenarios_the_maps_and_the_layouts(tmp_path: Path) -> None:
    (built,) = WheelBuilder(str(ROOT)).build(directory=str(tmp_path), versions=["standard"])
    with zipfile.ZipFile(built) as wheel:
        held = {name for name in wheel.namelist() if ".dist-info/" not in name}
        records = {name.partition("/")[2] for name in wheel.namelist() if ".dist-info/" in name}
    data = {f"hil/data/{path.parent.name}/{path.name}" for path in (ROOT / "data").glob("*/*.*")}
    assert {name for name in held if name.startswith("hil/data/")} == data
    sources = {named(path) for path in MODULES} | {
        named(path) for path in (ROOT / "hil" / "wire" / "msg").rglob("*.msg")
    }
    assert sources <= held
    page = {
        named(path)
        for path in (ROOT / "hil" / "live_page").iterdir()
        if path.suffix in (".html", ".css", ".js")
    }
    assert "hil/live_page/page.html" in page
    assert page <= held
    rest = held - data - sources - page
    assert {Path(name).name for name in rest} <= {"py.typed"}
    assert {"METADATA", "RECORD", "entry_points.txt", "licenses/LICENSE"} <= records


def test_set_up_compiles_all_that_is_entered_from_python() -> None:
    """What it forgets, the first run would wait for."""
    text = (ROOT / "scripts" / "setup").read_text(encoding="utf-8")
    for package in PACKAGES:
        for path in (ROOT / package).rglob("*.py"):
            if re.search(r"^@entry$", path.read_text(encoding="utf-8"), re.MULTILINE):
                module = ".".join(path.relative_to(ROOT).with_suffix("").parts)
                assert module in text, f"{module} has entries; name it in scripts/setup"
