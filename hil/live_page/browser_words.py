"""What a browser says to the page's server: checked before anything is made of it."""

from __future__ import annotations

from typing import Annotated, Literal

import msgspec
from msgspec import Meta

LARGEST_WORDS = 2048
"""Bytes of the longest thing that a browser says; a longer one is not read."""

_Text = Annotated[str, Meta(max_length=256)]
_Count = Annotated[int, Meta(ge=0, le=2**53)]


class Hello(msgspec.Struct, frozen=True, tag="hello", tag_field="say", forbid_unknown_fields=True):
    """The first word, with the token."""

    token: _Text


class Seen(msgspec.Struct, frozen=True, tag="seen", tag_field="say", forbid_unknown_fields=True):
    """A frame was drawn."""

    frame: _Count


class Look(msgspec.Struct, frozen=True, tag="look", tag_field="say", forbid_unknown_fields=True):
    """Which follower is looked at, by its place."""

    follower: _Count


class Stop(msgspec.Struct, frozen=True, tag="stop", tag_field="say", forbid_unknown_fields=True):
    """Everybody is to stop."""


class Arm(msgspec.Struct, frozen=True, tag="arm", tag_field="say", forbid_unknown_fields=True):
    """A robot may be driven again, by its name; all of them, by none. ``frame``: the last that was seen."""

    frame: _Count
    robot: _Text = ""


class ChangeSide(msgspec.Struct, frozen=True, tag="side", tag_field="say", forbid_unknown_fields=True):
    """The follower is to go to a side of its leader. ``frame``: the last that was seen."""

    frame: _Count
    side: Literal["left", "right"]


class Posted(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """An order by POST, where the way of the page does not answer."""

    token: _Text
    order: Stop | Arm | ChangeSide


Word = Hello | Seen | Look | Stop | Arm | ChangeSide
Order = Stop | Arm | ChangeSide

_words: msgspec.json.Decoder[Word] = msgspec.json.Decoder(Word)
_posts: msgspec.json.Decoder[Posted] = msgspec.json.Decoder(Posted)


def read_word(said: str | bytes) -> Word | None:
    """What was said, None for what is nothing that a browser says."""
    try:
        return _words.decode(said) if len(said) <= LARGEST_WORDS else None
    except (msgspec.DecodeError, UnicodeError, RecursionError):
        return None


def read_post(body: bytes) -> Posted | None:
    """An order that was posted, None for what is none."""
    try:
        return _posts.decode(body) if len(body) <= LARGEST_WORDS else None
    except (msgspec.DecodeError, UnicodeError, RecursionError):
        return None
