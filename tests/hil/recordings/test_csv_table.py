from __future__ import annotations

from decimal import Decimal
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from hil.errors import UsageError
from hil.recordings.column_map import ColumnMap, load_column_map
from hil.recordings.csv_table import read_rows, read_table

MAP = """
[columns]
t = "time"
rho = { column = "range", scale = 0.001, offset = 0.5 }
alpha2 = "bearing"
v2 = { constant = 0.1 }
u2 = "gyro"
[truth]
v1 = "speed"
[scenario.estimator]
front_end = "body"
"""
HEAD = "time,range,bearing,gyro,speed\n"
ROWS = "0.5,200,0.1,0.2,0.08\n0.6,210,0.2,0.3,0.09\n"


def chart(folder: Path, text: str = MAP) -> ColumnMap:
    (folder / "lab.toml").write_text(text)
    return load_column_map(str(folder / "lab.toml"))


def recording(folder: Path, text: str | bytes) -> Path:
    path = folder / "lab.csv"
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return path


def test_rows_have_the_values_that_the_map_makes_of_them(tmp_path: Path) -> None:
    first, second = read_rows(recording(tmp_path, HEAD + ROWS), chart(tmp_path))
    assert first.t_ns == 500_000_000
    assert first.columns == {"rho": pytest.approx(0.7), "alpha2": 0.1, "v2": 0.1, "u2": 0.2}
    assert first.truth == {"v1": 0.08}
    assert second.columns["rho"] == pytest.approx(0.71)


@pytest.mark.parametrize(
    "text",
    [
        "\ufeff" + HEAD + ROWS,
        (HEAD + ROWS).replace("\n", "\r\n"),
        (HEAD + ROWS).replace(",", " , "),
        HEAD + ROWS + "\n\n",
        HEAD.replace("time", '"time"') + ROWS,
        "extra," + HEAD + "".join(f"text,{line}\n" for line in ROWS.splitlines()),
    ],
    ids=["byte order mark", "CRLF", "blanks", "empty lines", "quotes", "columns nobody asks for"],
)
def test_what_spreadsheets_write_is_read(text: str, tmp_path: Path) -> None:
    plain = read_rows(recording(tmp_path, HEAD + ROWS), chart(tmp_path))
    assert read_rows(recording(tmp_path, text), chart(tmp_path)) == plain


def test_another_delimiter_is_the_maps_to_name(tmp_path: Path) -> None:
    rows = read_rows(
        recording(tmp_path, (HEAD + ROWS).replace(",", ";")), chart(tmp_path, 'delimiter = ";"' + MAP)
    )
    assert len(rows) == 2


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(st.integers(0, 2**31 * 10**9 - 1), min_size=1, max_size=20, unique=True).map(sorted))
def test_times_keep_every_nanosecond(tmp_path: Path, times_ns: list[int]) -> None:
    lines = "".join(f"{Decimal(ns).scaleb(-9)},1,0,0,0\n" for ns in times_ns)
    rows = read_rows(recording(tmp_path, HEAD + lines), chart(tmp_path))
    assert [row.t_ns for row in rows] == times_ns


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", r"is empty; expected a line of column names"),
        ("\n", r"is empty"),
        (HEAD, r"has column names but no rows"),
        (
            HEAD.replace("gyro", "gyr") + ROWS,
            r"line 1: column 'gyro' of map .* is missing; did you mean 'gyr'",
        ),
        ("a,b\n1,2\n", r"column 'time' of map .* is missing; columns there: a, b"),
        (HEAD.replace("speed", "gyro") + ROWS, r"line 1: column 'gyro' is there 2 times"),
        (HEAD + ROWS.replace("0.3", "fast"), r"line 3, column 'gyro': 'fast', expected a number"),
        (HEAD + ROWS.replace("210,0.2", "210,"), r"line 3, column 'bearing': empty, expected a number"),
        (HEAD + ROWS.replace("0.3", "1_000"), r"line 3, column 'gyro': '1_000', expected a number"),
        (HEAD + ROWS.replace("0.3", "nan"), r"line 3, column 'gyro': nan, expected a finite number"),
        (
            HEAD + ROWS.replace("0.2,0.08", "-inf,0.08"),
            r"line 2, column 'gyro': -inf, expected a finite number",
        ),
        (HEAD + ROWS.replace("0.3", "1e999"), r"line 3, column 'gyro': inf is not finite"),
        (
            HEAD + ROWS.replace("0.6", "0.4"),
            r"line 3, column 'time': time 0\.4 s runs backwards .*\(0\.5 s\)",
        ),
        (
            HEAD + ROWS.replace("0.6", "0.5"),
            r"line 3, column 'time': time 0\.5 s repeats that of the row before",
        ),
        (HEAD + ROWS.replace("0.5", "-1"), r"line 2, column 'time': time -1\S* s, expected 0 or later"),
        (
            HEAD + ROWS.replace("0.6", "3e9"),
            r"line 3, column 'time': .* before 2038; set scale or offset of t",
        ),
        (HEAD + ROWS + "0.7,1\n", r"line 4 has 2 cells, expected 5"),
        (HEAD + "\n" + ROWS.replace("0.3", "x"), r"line 4, column 'gyro'"),
        (HEAD.encode() + b"\xff\xfe", r"not readable as CSV"),
        (HEAD + '0.5,"1,2\n', r"not readable as CSV"),
    ],
)
def test_a_mistake_in_a_recording_is_one_line_with_its_place(
    text: str | bytes, said: str, tmp_path: Path
) -> None:
    path = recording(tmp_path, text)
    with pytest.raises(UsageError, match=said) as caught:
        read_rows(path, chart(tmp_path))
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("name", "said"), [("none.csv", "no such file"), ("", "cannot be read")])
def test_a_recording_that_cannot_be_opened_is_said_so(name: str, said: str, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=said):
        read_rows(tmp_path / name, chart(tmp_path))


def test_columns_of_several_rates_share_a_table(tmp_path: Path) -> None:
    text = HEAD + "0.1,1,10,0.2,0.1\n0.2,,,0.3,0.1\n0.3,,,,\n0.4,1.1,11,,\n"
    rows = read_rows(recording(tmp_path, text), chart(tmp_path))
    assert [sorted(row.columns) for row in rows] == [
        ["alpha2", "rho", "u2", "v2"],
        ["u2", "v2"],
        [],
        ["alpha2", "rho"],
    ]


def test_a_column_that_is_empty_throughout_is_a_mistake(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="is empty in all rows"):
        read_rows(recording(tmp_path, HEAD + "0.1,,,0.2,0.1\n"), chart(tmp_path))


def test_a_line_that_the_file_ends_in_is_left_out_and_told(tmp_path: Path) -> None:
    found = read_table(recording(tmp_path, HEAD + ROWS + "0.7,1.0"), chart(tmp_path))
    assert (len(found.rows), found.torn) == (2, 4)
    assert read_table(recording(tmp_path, HEAD + ROWS), chart(tmp_path)).torn == 0
