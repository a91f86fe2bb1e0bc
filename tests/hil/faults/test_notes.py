"""Notes of the observer as lines and back."""

from __future__ import annotations

from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st

from hil.faults.notes import Notes, Rolled, Taken, read_lines, read_notes, rolled_line, stop_line, taken_line

numbers = st.floats(allow_nan=False, allow_infinity=False)
robots = st.sampled_from(["leader", "follower"])


@given(
    taken=st.lists(st.tuples(robots, st.builds(Taken, numbers, numbers, numbers, numbers))),
    rolled=st.lists(st.tuples(robots, st.builds(Rolled, numbers, numbers, numbers))),
    stops=st.lists(numbers),
)
def test_what_is_written_is_read(
    taken: list[tuple[str, Taken]], rolled: list[tuple[str, Rolled]], stops: list[float]
) -> None:
    lines = [taken_line(*each) for each in taken] + [rolled_line(*each) for each in rolled]
    notes = read_lines([*lines, *map(stop_line, stops)], Notes())
    for robot in ("leader", "follower"):
        assert notes.of(robot).taken == [each for name, each in taken if name == robot]
        assert notes.of(robot).rolled == [each for name, each in rolled if name == robot]
    assert notes.stops == stops


def test_a_line_that_is_cut_off_is_left_out(tmp_path: Path) -> None:
    path = tmp_path / "notes"
    assert read_notes(path).robots == {}
    whole = rolled_line("leader", Rolled(1.0, 2.0, 0.1))
    path.write_text(whole + whole[:-3], encoding="utf-8")
    notes = read_notes(path)
    assert notes.of("leader").rolled == [Rolled(1.0, 2.0, 0.1)]
    assert notes.end_s == 1.0
