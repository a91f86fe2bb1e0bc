"""Waiting for what other threads and signals bring.

The queues and events of the standard library are not for this: up to Python 3.12 a ``SimpleQueue`` whose wait
a signal breaks off just before its end goes on to wait for ever, and an ``Event`` that a handler sets while
its own thread is about to wait for it never comes back from there.
"""

from __future__ import annotations

import contextlib
import threading
import time
from collections import deque
from typing import Generic, TypeVar

Item = TypeVar("Item")


class Bell:
    """What one thread waits for and any other rings, a signal handler of the waiting one too.

    Rung more than once before it is waited for, it is heard once.

    >>> bell = Bell()
    >>> bell.ring()
    >>> bell.wait(0.0), bell.wait(0.0)
    (True, False)
    """

    def __init__(self) -> None:
        self._silent = threading.Lock()
        self._silent.acquire()

    def ring(self) -> None:
        """End the wait that goes on, or the next one."""
        if self._silent.locked():
            # Two may ring at once.
            with contextlib.suppress(RuntimeError):
                self._silent.release()

    def wait(self, timeout: float) -> bool:
        """Whether it was rung within ``timeout`` [s]."""
        return self._silent.acquire(timeout=max(0.0, timeout))


class Mailbox(Generic[Item]):
    """Items in order of arrival, put there by any thread and taken by one.

    >>> mailbox = Mailbox[str]()
    >>> mailbox.put("a")
    >>> len(mailbox), mailbox.take(0.0), mailbox.take(0.0)
    (1, 'a', None)
    """

    def __init__(self) -> None:
        self._items: deque[Item] = deque()
        self._bell = Bell()

    def __len__(self) -> int:
        return len(self._items)

    def put(self, item: Item) -> None:
        """Append an item; a signal handler may, too."""
        self._items.append(item)
        self._bell.ring()

    def take(self, timeout: float) -> Item | None:
        """The next item, or None after ``timeout`` [s] without one."""
        until = time.monotonic() + timeout
        while True:
            with contextlib.suppress(IndexError):
                return self._items.popleft()
            if not self._bell.wait(until - time.monotonic()):
                return None
