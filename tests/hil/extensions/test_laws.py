"""Laws of one's own by reference: whatever can be called, loaded once."""

from __future__ import annotations

from pathlib import Path

import pytest

from hil.errors import UsageError
from hil.extensions.laws import own_law

FILE = """
class Law:
    __hash__ = None
    def __call__(self, shape, leader, gains):
        return 0.1, gains.k

law = Law()
"""


def test_what_has_no_hash_is_a_law_too_and_parameters_share_it(tmp_path: Path) -> None:
    text = f"{tmp_path / 'law_without_hash.py'}:law"
    (tmp_path / "law_without_hash.py").write_text(FILE)
    one, other = own_law(text, {"k": 1.0}), own_law(text, {"k": 2.0})
    assert one.at(*[0.0] * 7).function == other.at(*[0.0] * 7).function
    assert one.at(*[0.0] * 7).numbers != other.at(*[0.0] * 7).numbers
    with pytest.raises(UsageError, match=r"controller\.parameters: parameter 'mu1' of law law_without_hash"):
        own_law(text, {"mu1": 1.0})


ASKING = """
def law(shape, leader, gains):
    return gains.k * leader.v1, getattr(gains, "turn", 0.0)

def picky(shape, leader, gains):
    return shape.speed, 0.0
"""


def test_a_law_that_asks_for_a_gain_that_is_not_given_is_refused(tmp_path: Path) -> None:
    (tmp_path / "asking.py").write_text(ASKING)
    text = f"{tmp_path / 'asking.py'}:law"
    with pytest.raises(UsageError, match=r"asking\.py:law: asks for gains\.k, .*parameters\.k=NUMBER$"):
        own_law(text, {})
    own_law(text, {"k": 1.0})
    own_law(f"{tmp_path / 'asking.py'}:picky", {})


@pytest.mark.parametrize("text", ["operator:add", "shutil:copy2"])
def test_what_takes_other_arguments_is_refused_before_anything_is_driven_by_it(text: str) -> None:
    with pytest.raises(UsageError, match=f"{text}: cannot be called with shape, leader, gains "):
        own_law(text, {})
