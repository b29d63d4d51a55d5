"""A program that takes what others need: processor, memory or disk. It ends when its standard input does.

python -m hil_sim.faults.hog processor
python -m hil_sim.faults.hog memory BYTES
python -m hil_sim.faults.hog disk FILE BYTES
"""

import os
import select
import sys
from pathlib import Path

_PAGE = 4096
_BLOCK = 1 << 20


def _ended() -> bool:
    return bool(select.select([sys.stdin], [], [], 0.0)[0])


def processor() -> None:
    """Keep one core busy."""
    while not _ended():
        sum(range(100_000))


def memory(size: int) -> None:
    """Hold so many bytes, each page touched; the kernel's first choice when memory runs out."""
    Path("/proc/self/oom_score_adj").write_text("1000", encoding="ascii")
    block = bytearray(size)
    for page in range(0, size, _PAGE):
        block[page] = 1
    sys.stdin.read()


def disk(file: Path, size: int) -> None:
    """Write one file of so many bytes again and again, and wait for the disk after each block."""
    with file.open("wb", buffering=0) as target:
        file.unlink()  # nothing is left behind, whatever ends us
        while not _ended():
            if target.tell() + _BLOCK > size:
                target.seek(0)
            target.write(os.urandom(_BLOCK))
            os.fsync(target.fileno())


def main(what: str, *words: str) -> None:
    """Run until standard input ends."""
    if what == "processor":
        processor()
    elif what == "memory":
        memory(int(words[0]))
    elif what == "disk":
        disk(Path(words[0]), int(words[1]))


if __name__ == "__main__":
    main(*sys.argv[1:])
