from __future__ import annotations

import subprocess
import sys
import threading
import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.wire.mailbox import Bell, Mailbox

PATIENCE = 60.0

STORM = """
import signal
from hil.wire.mailbox import Bell, Mailbox

mailbox, bell, rung = Mailbox[int](), Bell(), 0

def handle(*_):
    global rung
    rung += 1
    if rung % 50 == 0:
        mailbox.put(rung)
        bell.ring()

signal.signal(signal.SIGALRM, handle)
signal.setitimer(signal.ITIMER_REAL, 2e-4, 1.73e-4)
items = [mailbox.take(5e-4) for _ in range(2000)]
heard = [bell.wait(5e-4) for _ in range(1000)]
signal.setitimer(signal.ITIMER_REAL, 0.0)
assert {None} < set(items), items
assert set(heard) == {True, False}, heard
"""


def test_signals_that_break_off_a_wait_again_and_again_end_none_and_prolong_none() -> None:
    subprocess.run([sys.executable, "-c", STORM], check=True, timeout=PATIENCE)


@given(st.lists(st.one_of(st.integers(), st.none())))
def test_items_come_out_in_the_order_in_which_they_were_put(words: list[int | None]) -> None:
    """None stands for a take."""
    mailbox, put, taken = Mailbox[int](), list[int](), list[int]()
    for word in words:
        if word is not None:
            mailbox.put(word)
            put.append(word)
        elif (item := mailbox.take(0.0)) is not None:
            taken.append(item)
        assert len(mailbox) == len(put) - len(taken)
    while (item := mailbox.take(0.0)) is not None:
        taken.append(item)
    assert taken == put


def test_none_is_lost_that_many_threads_put() -> None:
    mailbox = Mailbox[int]()

    def put_all(first: int) -> None:
        for k in range(2000):
            mailbox.put(first + k)

    threads = [threading.Thread(target=put_all, args=[first]) for first in (0, 10_000, 20_000)]
    for thread in threads:
        thread.start()
    taken = [mailbox.take(PATIENCE) for _ in range(6000)]
    assert mailbox.take(0.0) is None
    for first in (0, 10_000, 20_000):
        assert [item for item in taken if item is not None and 0 <= item - first < 2000] == [
            first + k for k in range(2000)
        ]


def test_who_waits_is_woken_at_once() -> None:
    mailbox = Mailbox[str]()
    threading.Timer(0.1, mailbox.put, ["here"]).start()
    begun = time.monotonic()
    assert mailbox.take(PATIENCE) == "here"
    assert time.monotonic() - begun < PATIENCE / 2


def test_a_bell_that_was_heard_is_silent_and_does_not_cut_a_wait_short() -> None:
    mailbox = Mailbox[int]()
    mailbox.put(1)
    assert mailbox.take(0.0) == 1
    begun = time.monotonic()
    assert mailbox.take(0.2) is None
    assert time.monotonic() - begun >= 0.19


@pytest.mark.parametrize("timeout", [0.0, -1.0, -1e9])
def test_a_time_that_is_over_is_no_wait(timeout: float) -> None:
    assert Mailbox[int]().take(timeout) is None
    assert not Bell().wait(timeout)
