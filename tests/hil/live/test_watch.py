from __future__ import annotations

from hil.live.watch import Picture

PATIENCE = 3.0


def watched(picture: Picture, looks: int, seconds: float) -> str | None:
    for _ in range(looks):
        picture.watch_on(seconds)
    return picture.silent(("estimator", "emulator"), PATIENCE)


def test_a_daemon_that_was_heard_and_falls_silent_is_named() -> None:
    picture = Picture()
    assert watched(picture, 100, 0.05) is None
    picture.heard["emulator"] = picture.watched_s
    assert watched(picture, 50, 0.05) is None
    assert watched(picture, 20, 0.05) == "emulator"


def test_a_machine_that_stands_still_makes_nobody_silent() -> None:
    picture = Picture()
    picture.heard["estimator"] = picture.watched_s
    assert watched(picture, 1, 60.0) is None
    assert watched(picture, 50, 0.05) is None
    assert watched(picture, 20, 0.05) == "estimator"
