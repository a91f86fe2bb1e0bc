from __future__ import annotations

import ast
from pathlib import Path

import pytest

from benchmarks.mutations import mutants

ROOT = Path(__file__).resolve().parents[2]
MODULES = [ROOT / "controllers" / "laws.py", ROOT / "controllers" / "resolution.py"]


def changed(text: str) -> set[str]:
    return {ast.unparse(ast.parse(each.text)) for each in mutants(text)}


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("x = a - b * c", {"x = a + b * c", "x = a - b / c"}),
        ("x = a / b ** p", {"x = a * b ** p", "x = a / (b * p)"}),
        ("x = a < b", {"x = a <= b", "x = a >= b"}),
        ("x = a and (not b)", {"x = a or not b", "x = a and b"}),
        ("x = math.sin(-a)", {"x = math.cos(-a)", "x = math.sin(a)"}),
        ("x = max(a, b)", {"x = min(a, b)"}),
        ("x = f(a, b)", {"x = f(b, a)"}),
        ("x = a if b else c", {"x = c if b else a"}),
        ("x = 2", {"x = 3"}),
        ("x = 0.5", {"x = 1.0"}),
        ("x += a", {"x -= a"}),
        ("f(a)", {"pass"}),
    ],
)
def test_each_slip_is_made(text: str, expected: set[str]) -> None:
    assert changed(text) == {ast.unparse(ast.parse(each)) for each in expected}


def test_what_is_said_is_left_alone() -> None:
    text = '@cached(size=3)\ndef f(a: int | None) -> int | None:\n    """1 < 2."""\n    raise E(f"{a + 1}")\n'
    assert [each.kind for each in mutants(text)] == ["deletion"]


@pytest.mark.parametrize("path", MODULES, ids=lambda path: path.name)
def test_every_mutant_is_a_program_of_its_own(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    found = mutants(text)
    assert len({each.text for each in found}) == len(found)
    plain = ast.dump(ast.parse(text))
    assert all(ast.dump(ast.parse(each.text)) != plain for each in found)
    assert all(each.diff for each in found)
