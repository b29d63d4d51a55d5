"""Attacks by connections: many, slow ones, such as never read, and such as come only to go."""

import time
from dataclasses import replace

from tests.attack.attack import Strike
from tests.attack.barrage import SAME, Barrage, Manner, Said, Target, barrage, request

IDLE, SLOW, NEVER_READ = 200, 60, 8
_LINE = request("clock.read").rstrip(b"\n") + b" " * 60_000
_BIG = (
    request("resource.snapshot", include=["cmdline"]) + request("robot.describe") + request("parameter.list")
)


def idle(target: Target) -> Said:
    return barrage(target, IDLE, Manner())


def idle_beside(target: Target) -> Said:
    """As through a tunnel: whoever comes to stop has the same address as the attacker."""
    return idle(replace(target, source=SAME))


def slow(target: Target) -> Said:
    return barrage(target, SLOW, Manner(_LINE, piece=1, pause_s=1.0))


def never_read(target: Target) -> Said:
    """Half of them have every stream, half ask for all that is big."""
    stream = Manner(opening=request("stream.start", modules=["component"], rate_hz=0), silent=True)
    ask = Manner(_BIG, silent=True)
    return Barrage(target, NEVER_READ, lambda number: ask if number % 2 else stream).run()


def come_and_go(target: Target) -> Said:
    """One connection after another, each closed as soon as it is there."""
    until, refused, error = time.monotonic() + target.seconds, 0, None
    while time.monotonic() < until:
        try:
            target.connect().close()
        except OSError as failed:
            refused, error = refused + 1, error or str(failed)
    return Said.of(None, error, answered=False, ended=refused)


ATTACKS = (
    Strike("idle", f"{IDLE} idle connections", idle),
    Strike("idle-same-address", f"{IDLE} idle connections from the stopper's address", idle_beside),
    Strike("slow-loris", f"a byte a second of a line, {SLOW} connections", slow),
    Strike("never-read", "streams and big answers that nobody reads", never_read),
    Strike("come-and-go", "connections that are closed at once", come_and_go),
)
