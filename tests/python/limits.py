"""A time limit for every test, so that a hang is a failure with the test's name."""

import contextlib
import faulthandler
import signal
import unittest


class TimeLimit(BaseException):
    """Not an Exception, so that no handler of a test or of the client takes it for its own."""


class LimitedTest(unittest.TestCase):
    """`limit_s` is for each test with its setUp and tearDown, and for setUpClass."""

    limit_s = 300

    def run(self, result=None):
        with limited(self.limit_s, self.id()):
            return super().run(result)


@contextlib.contextmanager
def limited(seconds, name):
    """Raises TimeLimit in the main thread after that time, and again while cleaning up takes long. A
    test that does not end even so ends the process, with the stacks of all threads."""

    def stop(*_):
        raise TimeLimit(f"{name} takes longer than {seconds} s")

    before = signal.signal(signal.SIGALRM, stop)
    outer = signal.setitimer(signal.ITIMER_REAL, seconds, max(seconds, 30))
    faulthandler.dump_traceback_later(seconds + 150, exit=True)
    try:
        yield
    finally:
        faulthandler.cancel_dump_traceback_later()
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
        signal.setitimer(signal.ITIMER_REAL, *outer)
