"""A gateway's memory is locked as long as somebody needs it, in a process of its own."""

import subprocess
import sys

import pytest

from gateway.process.memory import _is_allowed

PROGRAM = """
import re
from pathlib import Path
from gateway.process.memory import MemoryLock

def locked():
    return int(re.search(r"VmLck:\\s+(\\d+)", Path("/proc/self/status").read_text())[1]) > 0

print(locked())
for step in (MemoryLock.begin, MemoryLock.begin, MemoryLock.give_back, MemoryLock.end, MemoryLock.end):
    step()
    print(locked())
assert MemoryLock.problem is None
"""


@pytest.mark.skipif(not _is_allowed(), reason="memory may not be locked here")
def test_it_is_locked_from_the_first_who_needs_it_to_the_last() -> None:
    said = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=True).stdout
    assert said.split() == ["False", "True", "True", "True", "True", "False"]
