"""What a guard reads off the wire, against the general codec."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from formation.pose import Motion
from hil.guard.reading import read_driven, read_wanted, read_word
from hil.guard.robot_guard import WantedDrive
from hil.wire import message_types as msg
from hil.wire.drive_message import drive_message
from hil.wire.messages import MalformedPayloadError, decode_as, encode

FINITE = st.floats(allow_nan=False)
STAMPS = st.integers(0, 2**31 * 10**9 - 1)


@given(FINITE, FINITE, STAMPS, st.text(st.characters(exclude_characters="\0", exclude_categories=["Cs"])))
def test_commands_and_words_are_read_as_they_were_written(v: float, u: float, at_ns: int, word: str) -> None:
    stamped = encode(drive_message(Motion(v, u), at_ns, word, stamped=True))
    assert read_wanted(stamped) == WantedDrive(Motion(v, u), at_ns)
    assert read_driven(stamped, True) == Motion(v, u)
    bare = encode(drive_message(Motion(v, u), at_ns, word, stamped=False))
    assert read_driven(bare, False) == Motion(v, u)
    assert read_word(encode(msg.String(data=word))) == word


@given(st.binary(max_size=120))
def test_what_is_none_is_none_and_nothing_raises(payload: bytes) -> None:
    for head in (b"", b"\0\1\0\0"):
        given = head + payload
        assert (read_word(given) is None) == (not _is(given, msg.String))
        if read_wanted(given) is not None:
            assert _is(given, msg.TwistStamped)
        read_driven(given, False)


def _is(payload: bytes, kind: type[msg.String] | type[msg.TwistStamped]) -> bool:
    if payload[:2] != b"\0\1":
        return False
    try:
        decode_as(payload, kind)
    except MalformedPayloadError:
        return False
    return True
