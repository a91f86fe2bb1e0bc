"""Kernels give the same bits compiled and as plain Python, and a change below an entry recompiles it."""

from __future__ import annotations

import ast
import math
import os
import struct
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple, cast

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from formation.byte_access import (
    read_byte,
    read_float,
    read_int32,
    read_uint32,
    write_byte,
    write_float,
    write_int32,
    write_int64,
)
from formation.kernel import entry, interpreted, kernel
from formation.lending import lent
from formation.records import (
    Buffer,
    Rows,
    borrowed,
    columns_of,
    copy_of,
    dtype_of,
    load,
    row_of,
    rows_of,
    size,
    store,
)

ROOT = Path(__file__).resolve().parent.parent.parent


class Place(NamedTuple):
    x: float
    y: float


class Body(NamedTuple):
    place: Place
    number: int
    seen: bool

    @kernel
    def moved(self, dx: float) -> Body:
        return self._replace(place=shifted(self.place, dx), number=self.number + 1, seen=not self.seen)


@kernel
def shifted(place: Place, dx: float) -> Place:
    return place._replace(x=place.x + dx)


@kernel(inline=False)
def all_moved(bodies: Rows[Body], dx: float) -> float:
    total = 0.0
    for k in range(size(bodies)):
        body = load(Body, bodies, k).moved(dx)
        store(bodies, k, body)
        total += body.place.x
    return total


@entry
def move_all(bodies: Rows[Body], dx: float) -> float:
    return all_moved(borrowed(bodies), dx)


@entry
def copied(payload: bytes, buffer: Buffer) -> int:
    write_float(buffer, 1, read_float(payload, 1))
    write_int32(buffer, 9, read_int32(payload, 9))
    write_int32(buffer, 13, read_uint32(payload, 13))
    write_byte(buffer, 0, read_byte(payload, 0))
    write_int64(buffer, 17, read_int32(payload, 9))
    return read_uint32(payload, 13)


class Workplace(NamedTuple):
    number: int
    bodies: Rows[Body]
    buffer: Buffer


@entry
def write_total(workplaces: Rows[Workplace], dx: float) -> int:
    here = load(Workplace, workplaces, 0)
    write_float(here.buffer, 1, all_moved(here.bodies, dx))
    return here.number + size(here.bodies)


def bodies() -> Rows[Body]:
    rows = rows_of(Body, 3)
    store(rows, 1, Body(Place(1.0, 2.0), 5, True))
    return rows


def test_compiled_and_plain_give_the_same() -> None:
    compiled, plain = bodies(), bodies()
    assert move_all(compiled, 0.5) == interpreted(move_all)(plain, 0.5) == 2.5
    assert columns_of(compiled).tobytes() == columns_of(plain).tobytes()
    assert load(Body, compiled, 1) == Body(Place(1.5, 2.0), 6, False)
    assert load(Body, compiled, 2) == Body(Place(0.5, 0.0), 1, True)


def test_a_list_serves_plain_python_as_well_as_rows() -> None:
    kept: list[Body] = [Body(Place(1.0, 2.0), 5, True)]
    assert all_moved(kept, 0.5) == 1.5  # type: ignore[arg-type]
    assert kept == [Body(Place(1.5, 2.0), 6, False)]


def test_an_entry_works_in_rows_that_it_is_lent() -> None:
    found = []
    for function in (write_total, interpreted(write_total)):
        place = Workplace(7, bodies(), np.zeros(9, np.uint8))
        plain = cast("Rows[Workplace]", [place])
        assert function(lent(place) if function is write_total else plain, 0.5) == 10
        found.append((columns_of(place.bodies).tobytes(), place.buffer.tobytes()))
    assert found[0] == found[1]
    assert struct.unpack_from("<d", found[0][1], 1) == (2.5,)


@given(st.integers(0, 255), st.floats(), st.integers(-(2**31), 2**31 - 1), st.integers(0, 2**32 - 1))
def test_bytes_are_read_and_written_where_they_lie(byte: int, real: float, signed: int, plain: int) -> None:
    payload = struct.pack("<BdiI", byte, real, signed, plain)
    for function in (copied, interpreted(copied)):
        buffer = np.zeros(25, np.uint8)
        assert function(payload, buffer) == plain
        assert buffer.tobytes() == payload + struct.pack("<q", signed)


def test_a_row_holds_what_was_put_there() -> None:
    row = row_of(Body(Place(0.1, math.inf), -3, True))
    assert load(Body, row, 0) == Body(Place(0.1, math.inf), -3, True)


def test_a_copy_holds_the_same_and_is_another() -> None:
    rows = bodies()
    copied_rows = copy_of(rows)
    assert columns_of(copied_rows).tobytes() == columns_of(rows).tobytes()
    store(copied_rows, 1, Body(Place(0.0, 0.0), 0, False))
    assert load(Body, rows, 1) == Body(Place(1.0, 2.0), 5, True)


def test_what_no_row_can_hold_is_named() -> None:
    class Named(NamedTuple):
        name: str

    with pytest.raises(TypeError, match=r"Named\.name"):
        dtype_of(Named)


LEAF = """from formation.kernel import kernel
WEIGHT = {weight}
@kernel
def weighed(x: float) -> float:
    return WEIGHT * x
"""
TOP = """from __future__ import annotations
import sys
from formation.compiler import DISPATCHERS
from formation.kernel import entry
from formation.leaf_of_a_test import weighed
@entry
def answer(x: float) -> float:
    return weighed(x)
print(answer(2.0), sum(DISPATCHERS[answer].stats.cache_hits.values()))
"""


def house_of_a_test(folder: Path, top: str) -> Callable[[str], str]:
    """A copy of the package with a module ``top`` that is run with what a module below it holds."""
    package = folder / "formation"
    package.mkdir()
    for source in (ROOT / "formation").glob("*.py"):
        (package / source.name).write_text(source.read_text())
    (package / "top_of_a_test.py").write_text(top)

    def run(leaf: str) -> str:
        (package / "leaf_of_a_test.py").write_text(leaf)
        finished = subprocess.run(
            [sys.executable, "-B", "-m", "formation.top_of_a_test"],
            cwd=folder,
            env=os.environ | {"PYTHONPATH": str(folder)},
            capture_output=True,
            text=True,
            check=True,
        )
        return finished.stdout.strip()

    return run


def test_an_edit_in_an_imported_kernel_recompiles_and_nothing_else_does(tmp_path: Path) -> None:
    run = house_of_a_test(tmp_path, TOP)
    assert run(LEAF.format(weight="3.0")) == "6.0 0"
    assert run(LEAF.format(weight="3.0")) == "6.0 1"
    assert run(LEAF.format(weight="5.0")) == "10.0 0"


LOADING_TOP = TOP + 'print("scipy.linalg" in sys.modules)\n'


def test_only_compiling_loads_the_whole_compiler(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    run = house_of_a_test(tmp_path, LOADING_TOP)
    assert run(LEAF.format(weight="3.0")).split() == ["6.0", "0", "True"]
    assert run(LEAF.format(weight="3.0")).split() == ["6.0", "1", "False"]


RECORD = """from typing import NamedTuple
from formation.kernel import kernel
class {name}(NamedTuple):
    x: float
    number: int
Record = {name}
@kernel
def made(x: float) -> {name}:
    return {name}(x, 2)
"""
RECORD_TOP = """from __future__ import annotations
from formation.compiler import DISPATCHERS
from formation.kernel import entry
from formation.leaf_of_a_test import Record, made
@entry
def answer(x: float) -> Record:
    return made(x)
print(answer(2.0), sum(DISPATCHERS[answer].stats.cache_hits.values()))
"""


def test_what_was_kept_with_a_record_that_is_gone_is_compiled_anew(tmp_path: Path) -> None:
    run = house_of_a_test(tmp_path, RECORD_TOP)
    assert run(RECORD.format(name="Old")) == "Old(x=2.0, number=2) 0"
    assert run(RECORD.format(name="New")) == "New(x=2.0, number=2) 0"
    assert run(RECORD.format(name="New")) == "New(x=2.0, number=2) 1"


def test_without_numba_all_is_plain_python() -> None:
    code = (
        "import sys; sys.modules['numba'] = None\n"
        "from formation.kernel import entry, kernel\n"
        "def same(x: float) -> float: return x\n"
        "assert kernel(same) is same and entry(same) is same\n"
        "import formation.pose, formation.arc, formation.records\n"
    )
    subprocess.run([sys.executable, "-c", code], env=os.environ | {"ABREAST_INTERPRETED": "1"}, check=True)


KERNEL_FILES = sorted(
    path
    for package in ("formation", "controllers", "estimation", "hil")
    for path in (ROOT / package).rglob("*.py")
    if "@kernel" in path.read_text(encoding="utf-8")
)


def kernels_in(path: Path) -> list[ast.FunctionDef]:
    def marks(node: ast.FunctionDef) -> bool:
        names = [mark.func if isinstance(mark, ast.Call) else mark for mark in node.decorator_list]
        return any(isinstance(name, ast.Name) and name.id in ("kernel", "entry") for name in names)

    tree = ast.parse(path.read_text(encoding="utf-8"))
    return [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef) and marks(node)]


@pytest.mark.parametrize("path", KERNEL_FILES, ids=lambda path: str(path.relative_to(ROOT)))
def test_kernels_keep_to_what_gives_the_same_bits_everywhere(path: Path) -> None:
    for function in kernels_in(path):
        for node in ast.walk(function):
            assert not isinstance(node, ast.Pow), f"{function.name} uses **"
            if (
                isinstance(node, ast.Attribute)
                and isinstance(node.value, ast.Name)
                and node.value.id == "math"
            ):
                assert node.attr not in ("hypot", "dist", "pow", "remainder"), f"{function.name}: {node.attr}"


def test_no_two_records_have_a_kernel_of_one_name() -> None:
    """Compiled code finds a record's kernel by its name alone, and would take the other record's."""
    owners: dict[str, list[str]] = {}
    for path in KERNEL_FILES:
        marked = {node.lineno for node in kernels_in(path)}
        for record in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(record, ast.ClassDef):
                for node in record.body:
                    if isinstance(node, ast.FunctionDef) and node.lineno in marked:
                        owners.setdefault(node.name, []).append(record.name)
    assert len(owners) > 20
    assert not {name: records for name, records in owners.items() if len(records) > 1}
