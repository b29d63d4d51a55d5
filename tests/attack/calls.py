"""Attacks by requests that are good in their form and dear to answer."""

from tests.attack.attack import Strike
from tests.attack.barrage import Barrage, Manner, Said, Target, request
from tests.attack.lines import Lines
from tests.attack.robot_file import PARAMETER

GLOB_BYTES = 60_000
STREAMS, STREAMERS = 32, 8


def _matched(*globs: str) -> bytes:
    """Against every channel, and against every parameter."""
    return request("component.snapshot", channels=globs) + request("parameter.list", names=globs)


GLOB = _matched("a*" + "b" * GLOB_BYTES)
GLOBS = _matched(*(f"*a{number}*b*{'c' * 44}" for number in range(1000)))
STARS = _matched("*a" * (GLOB_BYTES // 2))
NAMES = (
    request("hello", client="n" * GLOB_BYTES)
    + request("control.acquire", ttl_s=5)
    + request("control.release")
)
READS = request("parameter.read", names=["*"])
TAIL = request("journal.tail", n=1000)
WRITES = request("control.acquire", ttl_s=60) + b"".join(
    request("parameter.write", changes={PARAMETER: value}) for value in range(100)
)


def streams(target: Target) -> Said:
    """Each stream is another one, so that none of the work is shared."""
    return Barrage(target, STREAMERS, lambda number: Manner(opening=_distinct(number))).run()


def _distinct(client: int) -> bytes:
    return b"".join(
        request(
            "stream.start",
            modules=["component"],
            rate_hz=1000 - (client * STREAMS + number) * 1e-3,
            channels=["joint_*.position"],
        )
        for number in range(STREAMS)
    )


ATTACKS = (
    Strike("glob-huge", "one glob of 60 kB, 4 clients", Lines(GLOB, 4)),
    Strike("globs-1000", "a thousand globs, 4 clients", Lines(GLOBS, 4)),
    Strike("glob-stars", "`*a*a*a*…` of 60 kB, 4 clients", Lines(STARS, 4)),
    Strike("streams", f"{STREAMS} distinct 1 kHz streams from each of {STREAMERS}", streams),
    Strike("names", "names of 60 kB, lease taken and given back", Lines(NAMES, 4)),
    Strike("tail", "the longest journal.tail, 4 clients", Lines(TAIL, 4)),
    Strike("reads", "every parameter from its drive, 4 clients", Lines(READS, 4)),
    Strike("writes", "parameter.write, 4 clients", Lines(WRITES, 4)),
)
