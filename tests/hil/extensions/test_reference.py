"""What others wrote is found, and digested, without being imported."""

from __future__ import annotations

import hashlib
import importlib
import importlib.util
import sys
from pathlib import Path
from typing import Any

import pytest

from hil.errors import UsageError
from hil.extensions.reference import brought, found, is_reference, loaded, settled, short


@pytest.fixture
def law_file(tmp_path: Path) -> Path:
    file = tmp_path / "some_law.py"
    file.write_text("raise SystemError('imported')\n")
    return file


def test_a_file_is_digested_without_being_imported(law_file: Path) -> None:
    reference = found(f"{law_file}:law", "law")
    assert reference.digest() == hashlib.sha256(law_file.read_bytes()).hexdigest()[:16]
    with pytest.raises(UsageError, match=r"cannot be loaded .SystemError: imported.; correct"):
        loaded(reference)


def test_a_module_is_found_without_importing_its_package(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    package = tmp_path / "lab_of_somebody"
    package.mkdir()
    (package / "__init__.py").write_text("raise SystemError('imported')\n")
    (package / "laws.py").write_text("def law(shape, leader, gains): return 0.0, 0.0\n")
    monkeypatch.syspath_prepend(tmp_path)
    reference = found("lab_of_somebody.laws:law", "law")
    assert reference.path == package / "laws.py"
    assert "lab_of_somebody" not in sys.modules
    with pytest.raises(UsageError, match=r"there is no module lab_of_somebody\.other"):
        found("lab_of_somebody.other:law", "law")


def test_a_reference_means_the_same_wherever_one_is(tmp_path: Path) -> None:
    assert settled("laws.py:mine", "law", "no.group", tmp_path) == f"{tmp_path}/laws.py:mine"
    assert settled("package.laws:mine", "law", "no.group", tmp_path) == "package.laws:mine"
    assert settled("unheard_of", "law", "no.group", tmp_path) == "unheard_of"
    assert short(f"{tmp_path}/laws.py:mine") == "laws.py:mine"
    assert not is_reference("independent")


@pytest.mark.parametrize("text", ["laws.py:", ":mine", "laws.py:not a name", "laws.py:1"])
def test_half_a_reference_says_what_is_expected(text: str, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"expected file\.py:name or package\.module:name"):
        settled(text, "law", "no.group", tmp_path)


def test_an_entry_point_is_settled_to_what_it_names(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    info = tmp_path / "lab_laws-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: lab-laws\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[abreast.laws]\ngentle = lab_laws.all:gentle\n")
    monkeypatch.syspath_prepend(tmp_path)
    assert settled("gentle", "law", "abreast.laws", tmp_path) == "lab_laws.all:gentle"


def test_what_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="there is no file"):
        found(f"{tmp_path}/none.py:law", "law")
    file = tmp_path / "names.py"
    file.write_text("law = 3\ndef other(): pass\n")
    with pytest.raises(UsageError, match="law is no function but int there; names in it: law, other"):
        loaded(found(f"{file}:law", "law"))
    with pytest.raises(UsageError, match="third is nothing there"):
        loaded(found(f"{file}:third", "law"))


def test_few_names_of_many_are_told_and_a_file_that_answers_for_names_may_fail(tmp_path: Path) -> None:
    many, odd = tmp_path / "many_names.py", tmp_path / "odd_names.py"
    many.write_text("\n".join(f"name_{k} = 0" for k in range(30)))
    with pytest.raises(UsageError, match=r"names in it: name_0, .*name_11, \.\.\.$"):
        loaded(found(f"{many}:law", "law"))
    odd.write_text("__getattr__ = None\n")
    with pytest.raises(UsageError, match=r"odd_names.py:law: cannot be loaded \(TypeError: "):
        loaded(found(f"{odd}:law", "law"))


class _Finder:
    """As of a package that was installed to be edited: it is on nobody's path."""

    def __init__(self, name: str, file: Path) -> None:
        self.name, self.file = name, file

    def find_spec(self, name: str, path: Any, target: Any = None) -> Any:
        return importlib.util.spec_from_file_location(name, self.file) if name == self.name else None


def test_a_module_is_found_by_whoever_finds_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "elsewhere.py"
    file.write_text("def law(): return 5\n")
    monkeypatch.setattr(sys, "meta_path", [*sys.meta_path, _Finder("laws_to_edit", file)])
    reference = found("laws_to_edit:law", "law")
    assert reference.path == file
    assert "laws_to_edit" not in sys.modules
    assert loaded(reference)() == 5
    with pytest.raises(UsageError, match="there is no module builtins"):
        found("builtins:len", "law")


def test_a_file_finds_its_neighbours(tmp_path: Path) -> None:
    (tmp_path / "neighbour_of_a_law.py").write_text("value = 7\n")
    file = tmp_path / "with_neighbour.py"
    file.write_text("from neighbour_of_a_law import value\ndef law(): return value\n")
    assert loaded(found(f"{file}:law", "law"))() == 7


def a_function_in_a_file() -> int:
    return 1


def test_a_function_of_a_file_that_was_edited_since_is_taken_from_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "law_at_hand.py").write_text("def law(): return 1\n")
    module = importlib.import_module("law_at_hand")
    text = brought(module.law)
    assert loaded(found(text, "law")) is module.law
    (tmp_path / "law_at_hand.py").write_text("def law(): return 22\n")
    assert loaded(found(text, "law"))() == 22


def test_a_function_at_hand_is_referred_to_by_its_file_or_kept() -> None:
    text = brought(a_function_in_a_file)
    assert text == f"{Path(__file__).absolute()}:a_function_in_a_file"

    assert loaded(found(text, "law")) is a_function_in_a_file

    def inner() -> int:
        return 2

    kept = brought(inner)
    assert kept == "program:inner"
    assert loaded(found(kept, "law")) is inner
    assert len(found(kept, "law").digest()) == 16
