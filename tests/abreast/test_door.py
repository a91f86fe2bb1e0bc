"""What ``import abreast`` gives: described names with examples that run, and nothing loaded early."""

from __future__ import annotations

import doctest
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import abreast

ROOT = Path(__file__).resolve().parents[2]
HEAVY = ("numba", "numpy", "scipy", "matplotlib", "bokeh", "rosbags", "mcap", "zenoh", "click")


def python(*arguments: str, folder: Path, path: str = "") -> subprocess.CompletedProcess[str]:
    """Python in a folder, with ``path`` before this checkout on its path."""
    there = os.pathsep.join(filter(None, [path, str(ROOT)]))
    return subprocess.run(
        [sys.executable, *arguments],
        capture_output=True,
        text=True,
        cwd=folder,
        env={**os.environ, "PYTHONPATH": there},
        check=False,
    )


def test_the_names_are_those_that_are_public() -> None:
    assert sorted(abreast.__all__) == dir(abreast)
    loaded = {name: getattr(abreast, name) for name in abreast.__all__}
    imported = {"annotations", "importlib", "sys", "Any", "TYPE_CHECKING", "refuse_hidden"}
    assert {name for name in vars(abreast) if not name.startswith("_")} - imported == loaded.keys() - {
        "__version__"
    }


def test_what_is_no_name_of_it_is_an_error() -> None:
    with pytest.raises(AttributeError, match="no attribute 'estimat'"):
        _ = abreast.estimat


@pytest.mark.parametrize("name", sorted(set(abreast.__all__) - {"__version__"}))
def test_every_name_is_described_with_an_example_that_runs(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    named: Any = getattr(abreast, name)
    examples = doctest.DocTestFinder(recurse=False).find(named, name, globs={})
    assert sum(len(each.examples) for each in examples) > 1
    for each in examples:
        assert doctest.DocTestRunner(optionflags=doctest.ELLIPSIS).run(each).failed == 0
        assert "import abreast" in (each.docstring or "")


def test_nothing_is_loaded_before_it_is_used(tmp_path: Path) -> None:
    ask = f"import abreast, sys; print([name for name in {HEAVY} if name in sys.modules])"
    assert python("-c", ask, folder=tmp_path).stdout.strip() == "[]"
    ask = "import abreast, sys; abreast.load_scenario('turtlebot3'); print('numba' in sys.modules)"
    assert python("-c", ask, folder=tmp_path).stdout.strip() == "False"


def hidden(folder: Path, name: str) -> Path:
    """Something of somebody's by the name of a package of ours: a module, or a package."""
    if name.endswith(".py"):
        path = folder / name
        path.write_text("x = 1\n", encoding="utf-8")
        return path
    (folder / name).mkdir()
    (folder / name / "__init__.py").write_text("", encoding="utf-8")
    return folder / name


@pytest.mark.parametrize("name", ["controllers", "estimation.py", "hil", "formation"])
def test_what_hides_a_package_is_told_in_one_line(name: str, tmp_path: Path) -> None:
    others = tmp_path / "others"
    others.mkdir()
    path = hidden(others, name)
    said = f"{path} hides abreast's package {path.stem!r}: rename it, or"
    for arguments in (("-m", "abreast", "--version"), ("-m", "abreast", "bounds")):
        result = python(*arguments, folder=others)
        assert result.returncode == 2
        assert result.stderr.startswith(f"abreast: {said}")
        assert result.stderr.count("\n") == 1
    result = python("-c", "import abreast", folder=tmp_path, path=str(others))
    assert result.returncode == 1
    assert said in result.stderr.splitlines()[-1]


def test_the_console_script_tells_it_too(tmp_path: Path) -> None:
    script = tmp_path / "abreast"
    script.write_text("from abreast.__main__ import main\nmain()\n", encoding="utf-8")
    others = tmp_path / "others"
    others.mkdir()
    path = hidden(others, "formation")
    result = python(str(script), "scenario", folder=tmp_path, path=str(others))
    assert result.returncode == 2
    assert result.stderr.startswith(f"abreast: {path} hides")
    assert result.stderr.count("\n") == 1


def test_a_folder_that_is_no_package_hides_nothing(tmp_path: Path) -> None:
    (tmp_path / "controllers").mkdir()
    assert python("-m", "abreast", "--version", folder=tmp_path).returncode == 0


def test_it_runs_as_a_module_by_either_name(tmp_path: Path) -> None:
    said = {python("-m", name, "--version", folder=tmp_path).stdout for name in ("abreast", "hil")}
    assert said == {f"abreast, version {abreast.__version__}\n"}


def test_arrays_of_results_are_numpy_s() -> None:
    t = np.arange(0.0, 0.1, 0.01)
    found = abreast.estimate(t, np.zeros((10, 2)), np.column_stack([np.ones(10), t, t]))
    assert {(type(column), column.shape) for column in found.as_dict().values()} == {(np.ndarray, (10,))}


def test_the_docs_list_every_name() -> None:
    text = (ROOT / "docs" / "api.md").read_text(encoding="utf-8")
    assert set(abreast.__all__) == set(re.findall(r"`(\w+)(?:\([^`]*\))?`", text)) & set(dir(abreast))


def test_the_example_of_the_readme_runs(tmp_path: Path) -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    result = python("-c", f"{code}\nprint(f'{{found.v1[-1]:.2f}}', run.summary['seed'])", folder=tmp_path)
    assert (result.returncode, result.stdout) == (0, "0.10 7\n"), result.stderr
