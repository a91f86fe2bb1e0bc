"""Whatever happens to a recording: it is read as far as it goes, or refused in a line and not written."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hil.errors import UsageError
from hil.log.reader import read_log
from hil.recordings.column_map import no_map
from hil.recordings.track_import import import_recording
from hil.wire import topics
from tests.recording_layouts import Motive, Qtm, Table, motive_text, qtm_text, table_text, tracks

PAIR = tracks(1, planar=True, gaps=True)
WHOLE = {
    "table": table_text(Table(), PAIR),
    "quaternions": table_text(Table(delimiter=";", decimal=",", turned="quaternion", comments=True), PAIR),
    "white space": table_text(Table(delimiter=" ", empty="nan", names="lx"), PAIR),
    "UTF-16": table_text(Table(encoding="utf-16"), PAIR),
    "Motive": motive_text(Motive(markers=True, strangers=1), PAIR),
    "Motive, Euler": motive_text(Motive(rotation="XYZ", version="1.25"), PAIR),
    "QTM": qtm_text(Qtm(), PAIR),
    "QTM, angles": qtm_text(Qtm(turned="angles", timed=False), PAIR),
}
PIECES = (
    b"",
    b",",
    b"\n",
    b'"',
    b";",
    b"\t",
    b"\0",
    b"nan",
    b"-",
    b"1e999",
    b"1e99999999999",
    b"X",
    b"#",
    b"\r",
    b"\xff",
)


@st.composite
def damaged(draw: st.DrawFn) -> bytes:
    """A recording in which some places are something else, or nothing."""
    text = draw(st.sampled_from(list(WHOLE.values())))
    for _ in range(draw(st.integers(1, 4))):
        begin = draw(st.integers(0, len(text)))
        end = min(len(text), begin + draw(st.sampled_from([0, 1, 2, 5, 30, 300, 100_000])))
        piece = draw(st.one_of(st.sampled_from(PIECES), st.binary(max_size=20)))
        text = text[:begin] + piece + text[end:]
    return text


@settings(max_examples=120, deadline=None)
@given(damaged())
def test_damage_is_survived_or_told_in_a_line(text: bytes) -> None:
    with TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "take.csv").write_bytes(text)
        log = folder / "log.mcap"
        told = refusal(folder / "take.csv", log)
        assert "\n" not in told
        assert log.exists() == (told == "")
        if not told:
            assert topics.RIGID_BODIES in read_log(log).topics


def refusal(recording: Path, log: Path) -> str:
    """What an import is refused by, nothing if it is not."""
    try:
        import_recording(recording, no_map("lab", None), log)
    except UsageError as error:
        return str(error)
    return ""


@pytest.mark.parametrize("kind", WHOLE.keys())
def test_a_cut_anywhere_in_the_rows_keeps_all_rows_before_it(kind: str, tmp_path: Path) -> None:
    text = WHOLE[kind]
    path = tmp_path / "take.csv"
    path.write_bytes(text)
    whole = import_recording(path, no_map("lab", None), tmp_path / "whole.mcap")
    for number, share in enumerate((0.97, 0.9, 0.8, 0.7, 0.6, 0.55)):
        path.write_bytes(text[: int(share * len(text))])
        done = import_recording(path, no_map("lab", None), tmp_path / f"{number}.mcap")
        assert whole.rows * (share - 0.5) < done.rows < whole.rows
        assert all("is cut off" in fault or "zero bytes" in fault for fault in done.damage)
