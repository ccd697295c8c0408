"""Ends the requests of several threads at once. Python delivers an interrupt (Ctrl-C) to the main thread only."""

from __future__ import annotations

import threading
import weakref
from typing import Protocol, Tuple, Type


class Stopped(BaseException):
    """The requests of a batch were ended. Not an Exception, so that no handler takes it for a failure."""


class Stoppable(Protocol):
    def stop(self) -> None:
        """Wakes the thread that waits for this."""


class Stop:
    """Passed to all that waits. Thread safe."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._event = threading.Event()
        self._waiting: weakref.WeakSet[Stoppable] = weakref.WeakSet()

    def __reduce__(self) -> Tuple[Type[Stop], Tuple[()]]:
        """A client that is sent to another process has a stop of its own there."""
        return Stop, ()

    def set(self) -> None:
        """Ends all waits, those that have begun and those that begin later."""
        with self._lock:
            self._event.set()
            for each in self._waiting:
                each.stop()

    def check(self) -> None:
        """Raises Stopped after `set`."""
        if self._event.is_set():
            raise Stopped

    def watch(self, waiting: Stoppable) -> None:
        """`set` stops that, too. Raises Stopped after `set`."""
        with self._lock:
            self._waiting.add(waiting)
        self.check()

    def pause(self, seconds: float) -> None:
        """Waits. Raises Stopped as soon as `set` is called."""
        self._event.wait(seconds)
        self.check()
