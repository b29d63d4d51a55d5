"""Parsing by one thread at a time, which is all that Python 3.11 can do.

Its parser counts in one place, for every thread, how deep a tree is that it makes. Two at once break each
other off with `SystemError: AST constructor recursion depth mismatch`, and what they read seems damaged.
numpy parses the header of each array that it loads, so whoever loads one is such a thread too.
"""

import threading
from collections.abc import Callable
from typing import Final, TypeVar

Result = TypeVar("Result")

TRIES: Final = 5  # a traceback that a log writes is parsed too, and there nobody asks us
_alone = threading.RLock()


def parsing(call: Callable[[], Result]) -> Result:
    """Return the result of `call`, which parses Python's syntax and can be repeated."""
    with _alone:
        for _ in range(TRIES - 1):
            try:
                return call()
            except SystemError:
                continue
        return call()
