from __future__ import annotations

import math
from decimal import Decimal
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from hil.errors import UsageError
from hil.recordings.column_map import ColumnMap, load_column_map
from hil.recordings.csv_table import Table, read_heading
from hil.recordings.csv_table import read_table as read_table_of
from hil.recordings.text_file import read_text

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


def read_table(path: Path, chart: ColumnMap) -> Table:
    text = read_text(path)
    return read_table_of(path, text, read_heading(path, text, chart.delimiter, chart.decimal), chart)


def plain(table: Table) -> tuple[list[int], dict[str, list[float]], dict[str, list[float]]]:
    """The same in what compares by values."""
    columns, truth = (
        {name: values.tolist() for name, values in some.items()} for some in (table.columns, table.truth)
    )
    return table.t_ns.tolist(), columns, truth


def test_rows_have_the_values_that_the_map_makes_of_them(tmp_path: Path) -> None:
    t_ns, columns, truth = plain(read_table(recording(tmp_path, HEAD + ROWS), chart(tmp_path)))
    assert t_ns == [500_000_000, 600_000_000]
    rho = [pytest.approx(0.7), pytest.approx(0.71)]
    assert columns == {"rho": rho, "alpha2": [0.1, 0.2], "v2": [0.1, 0.1], "u2": [0.2, 0.3]}
    assert truth == {"v1": [0.08, 0.09]}


@pytest.mark.parametrize(
    "text",
    [
        "\ufeff" + HEAD + ROWS,
        (HEAD + ROWS).replace("\n", "\r\n"),
        (HEAD + ROWS).replace("\n", "\r"),
        (HEAD + ROWS).replace(",", " , "),
        (HEAD + ROWS).replace(",", ";"),
        HEAD.replace(",", ";") + ROWS.replace(",", ";").replace(".", ","),
        HEAD + ROWS + "\n\n",
        HEAD.replace("time", '"time"') + ROWS,
        HEAD + "# a remark\n" + ROWS,
        "# a remark, of two\n" + HEAD + ROWS,
        "#" + HEAD + ROWS,
        "extra," + HEAD + "".join(f"text,{line}\n" for line in ROWS.splitlines()),
        "".join(f"{line},\n" for line in (HEAD + ROWS).splitlines()),
        HEAD + "".join(f"{line},\n" for line in ROWS.splitlines()),
    ],
    ids=[
        "byte order mark", "CRLF", "CR", "blanks", "semicolons", "decimal commas", "empty lines", "quotes",
        "comment", "comment above", "names in a comment", "columns nobody asks for", "comma at the end",
        "comma at the end of rows",
    ],
)  # fmt: skip
def test_what_spreadsheets_write_is_read(text: str, tmp_path: Path) -> None:
    expected = plain(read_table(recording(tmp_path, HEAD + ROWS), chart(tmp_path)))
    found = read_table(recording(tmp_path, text), chart(tmp_path))
    assert plain(found) == expected
    assert not found.damaged


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "utf-16-be", "utf-32", "utf-8-sig", "cp1252"])
def test_encodings_are_found(encoding: str, tmp_path: Path) -> None:
    expected = plain(read_table(recording(tmp_path, HEAD + ROWS), chart(tmp_path)))
    text = HEAD.replace("time", "time,größe") + "".join(
        line.replace(",", ",7,", 1) + "\n" for line in ROWS.splitlines()
    )
    assert plain(read_table(recording(tmp_path, text.encode(encoding)), chart(tmp_path))) == expected


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(st.integers(0, 2**31 * 10**9 - 1), min_size=1, max_size=20, unique=True).map(sorted))
def test_times_keep_every_nanosecond(tmp_path: Path, times_ns: list[int]) -> None:
    lines = "".join(f"{Decimal(ns).scaleb(-9)},1,0,0,0\n" for ns in times_ns)
    assert read_table(recording(tmp_path, HEAD + lines), chart(tmp_path)).t_ns.tolist() == times_ns


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
        (HEAD + ROWS.replace("0.3", "fast"), r"line 3, column 'gyro': 'fast', expected a finite number"),
        (HEAD + ROWS.replace("210,0.2", "210,"), r"line 3, column 'bearing': empty, expected a number"),
        (HEAD + ROWS.replace("0.3", "1_000"), r"line 3, column 'gyro': '1_000', expected a finite number"),
        (
            HEAD + ROWS.replace("0.2,0.08", "-inf,0.08"),
            r"line 2, column 'gyro': '-inf', expected a finite number",
        ),
        (HEAD + ROWS.replace("0.3", "1e999"), r"line 3, column 'gyro': '1e999', expected a finite number"),
        (
            HEAD + ROWS.replace("0.6", "0.4"),
            r"line 3, column 'time': time 0\.4 s runs backwards .*\(0\.5 s\)",
        ),
        (
            HEAD + ROWS.replace("0.6", "0.5"),
            r"line 3, column 'time': time 0\.5 s repeats that of the row before",
        ),
        (HEAD + ROWS.replace("0.5", "-1"), r"line 2, column 'time': '-1', expected a time from 0 to 2038"),
        (HEAD + ROWS.replace("0.6", "3e9"), r"line 3, column 'time': '3e9', expected a time from 0 to 2038"),
        (HEAD + ROWS.replace("0.6", ""), r"line 3, column 'time': empty, expected a time"),
        (HEAD + ROWS + "0.7,1\n", r"line 4 has 2 cells, expected 5"),
        (HEAD + "\n" + ROWS.replace("0.3", "x"), r"line 4, column 'gyro'"),
        (HEAD.encode() + bytes(range(256)), r"not readable as CSV"),
        (HEAD + '0.5,"1,2\n', r"line 2 has a quote that is not closed"),
    ],
)
def test_a_mistake_in_a_recording_is_one_line_with_its_place(
    text: str | bytes, said: str, tmp_path: Path
) -> None:
    path = recording(tmp_path, text)
    with pytest.raises(UsageError, match=said) as caught:
        read_table(path, chart(tmp_path))
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("name", "said"), [("none.csv", "no such file"), ("", "cannot be read")])
def test_a_recording_that_cannot_be_opened_is_said_so(name: str, said: str, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=said):
        read_table(tmp_path / name, chart(tmp_path))


@pytest.mark.parametrize("nothing", ["", "nan", "NaN", "NULL", "-", " "])
def test_columns_of_several_rates_share_a_table(nothing: str, tmp_path: Path) -> None:
    text = HEAD + "0.1,1,10,0.2,0.1\n0.2,,,0.3,0.1\n0.3,,,,\n0.4,1.1,11,,\n".replace(",,", f",{nothing},")
    found = read_table(recording(tmp_path, text), chart(tmp_path))
    there = {name: [math.isfinite(value) for value in values] for name, values in found.columns.items()}
    assert there["rho"] == there["alpha2"] == [True, False, False, True]
    assert there["v2"] == there["u2"] == [True, True, False, False]
    assert not found.damaged


def test_a_column_that_is_empty_throughout_is_a_mistake(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="is empty in all rows"):
        read_table(recording(tmp_path, HEAD + "0.1,,,0.2,0.1\n"), chart(tmp_path))


LONG = "".join(f"{k}.5,{200 + k},0.1,0.2,0.08\n" for k in range(40))


@pytest.mark.parametrize(
    ("damage", "line", "said"),
    [
        ("7.5,207,0.1,0.2", 9, "has 4 cells, expected 5"),
        ("7.5,207,0.1,0.2,0.08,3", 9, "has 6 cells, expected 5"),
        ("7.5,2\x0007,0.1,0.2,0.08", 9, "holds zero bytes"),
        ('7.5,207,0.1,"0.2,0.08', 9, "has a quote that is not closed"),
        ("7.5,207,0.1,0.2.3,0.08", 9, "column 'gyro': '0.2.3', expected a finite number"),
        ("7.5,,0.1,0.2,0.08", 9, "column 'range': empty, expected a number as in column 'bearing'"),
        ("6.5,207,0.1,0.2,0.08", 9, "time 6.5 s repeats that of the row before"),
        ("1.5,207,0.1,0.2,0.08", 9, "time 1.5 s runs backwards from the one of the row before"),
    ],
)
def test_a_damaged_line_among_many_is_left_out_and_told(
    damage: str, line: int, said: str, tmp_path: Path
) -> None:
    text = HEAD + LONG.replace("7.5,207,0.1,0.2,0.08", damage, 1)
    found = read_table(recording(tmp_path, text), chart(tmp_path))
    assert found.t_ns.tolist() == [k * 10**9 + 5 * 10**8 for k in range(40) if k != 7]
    assert list(found.damaged) == [line]
    assert said in found.damaged[line]


@pytest.mark.parametrize("cut", ["0.7", "0.7,1.0", "0.7,230,0.1,0.", "0.7,230,0.1,0.2,-"])
def test_a_line_that_the_file_ends_in_is_left_out_and_told(cut: str, tmp_path: Path) -> None:
    found = read_table(recording(tmp_path, HEAD + ROWS + cut), chart(tmp_path))
    assert (found.t_ns.tolist(), found.damaged) == ([500_000_000, 600_000_000], {4: "is cut off"})
    assert not read_table(recording(tmp_path, HEAD + ROWS), chart(tmp_path)).damaged
    assert not read_table(recording(tmp_path, HEAD + ROWS.rstrip()), chart(tmp_path)).damaged


def test_zeros_at_the_end_are_a_cut(tmp_path: Path) -> None:
    path = recording(tmp_path, (HEAD + ROWS + "0.7,230,").encode() + bytes(100))
    assert read_table(path, chart(tmp_path)).damaged == {4: "is cut off"}
    assert read_text(path).damage == ("it ends in 100 zero bytes, as after a power cut",)
