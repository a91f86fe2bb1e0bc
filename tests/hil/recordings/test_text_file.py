from __future__ import annotations

from pathlib import Path

import pytest

from hil.errors import UsageError
from hil.recordings import text_file
from hil.recordings.text_file import read_text

TEXT = "t,größe\n1,2\n\n3,4\n"


@pytest.mark.parametrize(
    ("encoding", "name"),
    [
        ("utf-8", "UTF-8"),
        ("utf-8-sig", "UTF-8 with byte order mark"),
        ("utf-16", "UTF-16"),
        ("utf-16-le", "UTF-16"),
        ("utf-16-be", "UTF-16"),
        ("utf-32", "UTF-32"),
        ("cp1252", "Windows-1252"),
    ],
)
@pytest.mark.parametrize("newline", ["\n", "\r\n", "\r"])
def test_encodings_and_ends_of_lines_are_found(
    encoding: str, name: str, newline: str, tmp_path: Path
) -> None:
    path = tmp_path / "lab.csv"
    path.write_bytes(TEXT.replace("\n", newline).encode(encoding))
    found = read_text(path)
    assert found == (["t,größe", "1,2", "", "3,4"], name, True, ())
    path.write_bytes(TEXT.replace("\n", newline)[: -len(newline)].encode(encoding))
    assert not read_text(path).whole


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "utf-32"])
def test_a_file_that_ends_within_a_letter_lacks_that_letter(encoding: str, tmp_path: Path) -> None:
    path = tmp_path / "lab.csv"
    path.write_bytes(TEXT.encode(encoding)[:-3])
    found = read_text(path)
    assert found.lines[:3] == ["t,größe", "1,2", ""]
    assert not found.whole


def test_zero_bytes_at_the_end_are_damage(tmp_path: Path) -> None:
    (tmp_path / "lab.csv").write_bytes(b"a,b\n1,2\n3," + bytes(5))
    found = read_text(tmp_path / "lab.csv")
    assert (found.lines, found.whole) == (["a,b", "1,2", "3,"], False)
    assert found.damage == ("it ends in 5 zero bytes, as after a power cut",)


def test_what_is_no_text_is_refused(tmp_path: Path) -> None:
    (tmp_path / "lab.csv").write_bytes(bytes(range(256)) * 20)
    with pytest.raises(UsageError, match="it is no text"):
        read_text(tmp_path / "lab.csv")


def test_a_file_too_large_is_refused_before_it_is_taken_apart(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(text_file, "LARGEST_BYTES", 1 << 20)
    (tmp_path / "lab.csv").write_bytes(b"1,2\n" * (1 << 18) + b"1")
    with pytest.raises(UsageError, match="has more than 1 MB; split it"):
        read_text(tmp_path / "lab.csv")
    (tmp_path / "lab.csv").write_bytes(b"1,2\n" * (1 << 18))
    assert len(read_text(tmp_path / "lab.csv").lines) == 1 << 18
