"""What is installed by choice: all else works without it, and one line says what brings it."""

from __future__ import annotations

import ast
import json
import re
import subprocess
import sys
import tomllib
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest

from hil.extras import EXTRA_OF, left_out_if_missing, missing_extra
from hil.log.reader import Log

ROOT = Path(__file__).resolve().parents[2]
HOUSE = ("formation", "controllers", "estimation", "hil", "abreast")
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
SHORT = ("--set", "run.duration_s=4", "--set", "run.evaluate_from_s=2")

WITHOUT = """
import sys
sys.modules.update(dict.fromkeys(sys.argv[1].split(",")))
"""
COMMAND = WITHOUT + "from hil.command_line import main; main(sys.argv[2:])"
LOADS = WITHOUT + "import importlib; [importlib.import_module(name) for name in sys.argv[2].split(',')]"


def without(modules: str, *arguments: str, code: str = COMMAND) -> subprocess.CompletedProcess[str]:
    """Run a command where these modules cannot be imported."""
    command = [sys.executable, "-c", code, modules, *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def names_of(requirements: list[str]) -> set[str]:
    """Names of distributions without their versions, as an index normalises them."""
    return {
        re.sub(r"[-_.]+", "-", re.split(r"[\s\[<>=!~;]", each, maxsplit=1)[0]).lower()
        for each in requirements
    }


def called_after(module: str, distributions: set[str]) -> set[str]:
    """Those distributions that are called after a module."""
    return {each for each in distributions if each.endswith(module.replace("_", "-"))}


def foreign_imports() -> dict[str, set[str]]:
    """Files that import what is neither ours nor Python's, by the top-level names of that."""
    found: dict[str, set[str]] = {}
    for path in (path for package in HOUSE for path in (ROOT / package).rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            modules: list[str] = []
            if isinstance(node, ast.Import):
                modules = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom):
                modules = [node.module or ""]
            elif isinstance(node, ast.Call) and ast.unparse(node.func).endswith(
                ("import_module", "find_spec")
            ):
                first = node.args[0]
                modules = [str(first.value)] if isinstance(first, ast.Constant) else []
            for module in modules:
                found.setdefault(module.partition(".")[0], set()).add(str(path.relative_to(ROOT)))
    ours = set(HOUSE) | set(sys.stdlib_module_names)
    return {name: files for name, files in found.items() if name not in ours}


def test_each_foreign_module_is_of_the_plain_install_or_of_an_extra() -> None:
    base, extras = names_of(PROJECT["dependencies"]), PROJECT["optional-dependencies"]
    known = packages_distributions()
    for name, files in foreign_imports().items():
        if (extra := EXTRA_OF.get(name)) is not None:
            held = names_of(extras[extra])
            # Those of ROS and of motion captures are not at hand everywhere.
            brings = held & names_of(known[name]) if name in known else called_after(name, held)
            assert brings, f"{name}: the extra {extra} does not bring it"
            assert not held & base, f"{name}: the extra {extra} is in the plain install too"
        elif name != "llvmlite":  # which is numba's own affair
            assert names_of(known[name]) & base, f"{name} of {files}: declare it, or name its extra"


def test_setting_up_brings_every_extra_that_this_python_can_have() -> None:
    held = set(re.findall(r"[\w-]+", PROJECT["optional-dependencies"]["all"][0].partition("[")[2]))
    assert set(EXTRA_OF.values()) - held == {"mocap", "ros"}


def test_the_page_on_installing_has_every_extra_with_its_libraries() -> None:
    page = (ROOT / "docs" / "install.md").read_text(encoding="utf-8")
    rows = {row[1]: row[0] for row in re.findall(r"^(\| `(\w+)` \|.*)$", page, re.MULTILINE)}
    for name, extra in EXTRA_OF.items():
        assert extra in rows, f"{extra}, which brings {name}, is not in docs/install.md"
        brings = names_of(PROJECT["optional-dependencies"][extra])
        assert extra == "ros" or all(f"`{each}`" in rows[extra] for each in brings), extra


def test_no_command_needs_an_extra_to_begin() -> None:
    modules = [f"hil.commands.{path.stem}" for path in (ROOT / "hil" / "commands").glob("[!_]*.py")]
    lazy = ("simulate", "judge", "sweep", "replay", "nodes", "live", "lockstep", "doctor", "soak", "faults")
    modules += [f"hil.{room}.{path.stem}" for room in lazy for path in (ROOT / "hil" / room).glob("[!_]*.py")]
    modules = [name for name in modules if name != "hil.live.tls_keys"]
    done = without(",".join(EXTRA_OF), ",".join(modules), code=LOADS)
    assert done.returncode == 0, done.stderr


def test_a_run_without_pictures_keeps_its_verdict_and_its_exit_code(tmp_path: Path) -> None:
    out = tmp_path / "out"
    done = without(",".join(EXTRA_OF), "run", "--lockstep", *SHORT, "--out", str(out), "--json")
    assert done.returncode == 0, done.stderr
    assert done.stderr.count("no run.png and no report.html: pip install 'abreast[report]'\n") == 1
    assert "Traceback" not in done.stderr
    written = json.loads((out / "summary.json").read_text(encoding="utf-8"))
    assert json.loads(done.stdout)["estimation"] == written["estimation"]
    assert not (out / "report.html").exists()


def test_an_experiment_without_pictures_leaves_its_table(tmp_path: Path) -> None:
    what = ("--duration", "2", "--stability", "--out", str(tmp_path), "--json")
    done = without("matplotlib", "simulate", *what)
    assert done.returncode == 0, done.stderr
    # Beside what tells how far it is.
    assert [line for line in done.stderr.splitlines() if not line.endswith(" ...")] == [
        "no simulation.png and no experiment.png: pip install 'abreast[report]'",
        "no stability.png: pip install 'abreast[report]'",
    ]
    assert {path.name for path in tmp_path.iterdir()} == {"trajectory.csv"}


def test_a_comparison_and_a_folder_of_logs_keep_their_exit_codes_without_pages_and_tables(
    tmp_path: Path, short_log: Log
) -> None:
    logs = tmp_path / "logs"
    logs.mkdir()
    for name in ("one", "two"):
        (logs / f"{name}.mcap").write_bytes(Path(short_log.path).read_bytes())
    judged = tmp_path / "judged"
    done = without("bokeh,pyarrow,matplotlib", "replay", str(logs), "--workers", "1", "--out", str(judged))
    assert done.returncode == 0, done.stderr
    assert "2 of 2 logs judged" in done.stdout
    assert "no results.parquet" in done.stderr
    assert (judged / "results.json").exists()
    pair = (str(logs / "one.mcap"), str(logs / "two.mcap"))
    wrong = ("--fail-if", "estimation.rmse.v1 > 0.5", "--out", str(tmp_path / "beside"))
    done = without("bokeh,pyarrow,matplotlib", "compare", *pair, *wrong)
    assert done.returncode == 1, done.stderr
    assert "estimation.rmse.v1" in done.stderr
    assert (tmp_path / "beside" / "compare.json").exists()


def test_a_sweep_without_tables_and_pages_leaves_its_results(tmp_path: Path) -> None:
    plan = ("--runs", "1", "--duration", "3", "--workers", "1", "--keep", "0:0", "--out", str(tmp_path))
    done = without("bokeh,pyarrow,matplotlib", "sweep", *plan)
    assert done.returncode == 0, done.stderr
    assert "no results.parquet: pip install 'abreast[tables]'" in done.stderr
    assert "no report.html: pip install 'abreast[report]'" in done.stderr
    assert f"results in {tmp_path}\n" in done.stdout
    assert json.loads((tmp_path / "results.json").read_text())["cells"][0]["kept"]


def test_an_estimator_without_its_library_is_one_line(tmp_path: Path) -> None:
    out = str(tmp_path / "out")
    done = without("filterpy", "run", "--lockstep", "--estimator", "ekf-filterpy", *SHORT, "--out", out)
    (line,) = [line for line in done.stderr.splitlines() if "filterpy" in line]
    assert (done.returncode, "pip install 'abreast[filterpy]'" in line) == (2, True)
    assert "Traceback" not in done.stderr


def test_what_is_no_extra_is_raised_as_it_is() -> None:
    with pytest.raises(ModuleNotFoundError), left_out_if_missing("soup"):
        raise ModuleNotFoundError("No module named 'spoon'", name="spoon")
    assert not missing_extra(ImportError("cannot import name", name="bokeh"))
