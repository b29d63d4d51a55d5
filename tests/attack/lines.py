"""Attacks by lines: many small ones, long ones, deep ones, and numbers that nobody has."""

from tests.attack.attack import Strike
from tests.attack.barrage import Manner, Said, Target, barrage, request

ONES = b"1\n" * (32 * 1024)
NEWLINES = b"\n" * (64 * 1024)
LONG = b"x" * (10 * 1000 * 1000) + b"\n"
DEPTH = 30_000
NESTED = b"[" * DEPTH + b"]" * DEPTH + b"\n"
STOPS = request("robot.stop", reason="attack") * (2_000_000 // len(request("robot.stop", reason="attack")))
HUGE = b"9" * 200
_ODD = (
    b'{"jsonrpc":"2.0","id":1,"id":2,"method":"clock.read","method":"robot.describe","params":{}}',
    b'{"jsonrpc":"2.0","id":%s,"method":"clock.read"}' % HUGE,
    b'{"jsonrpc":"2.0","id":1,"method":"journal.tail","params":{"n":%s}}' % HUGE,
    b'{"jsonrpc":"2.0","id":1,"method":"parameter.write","params":{"changes":{"joint_1.gain":%s}}}' % HUGE,
    b'{"jsonrpc":"2.0","id":1,"method":"parameter.write","params":{"changes":{"joint_1.gain":1e999}}}',
    b'{"jsonrpc":"2.0","id":1,"method":"stream.start","params":{"modules":["component"],"rate_hz":NaN}}',
    b'{"jsonrpc":"2.0","id":1,"method":"stream.start","params":{"modules":["component"],"rate_hz":1e999}}',
    b'{"jsonrpc":"2.0","id":1,"method":"control.acquire","params":{"ttl_s":-Infinity}}',
    b'{"jsonrpc":"2.0","id":1e999,"method":"control.acquire","params":{"ttl_s":1e308}}',
)
ODD = b"\n".join(_ODD) + b"\n"


class Lines:
    """Say this as fast as it is taken, and read what is answered."""

    def __init__(self, payload: bytes, connections: int = 1) -> None:
        self._payload = payload
        self._connections = connections

    def __call__(self, target: Target) -> Said:
        return barrage(target, self._connections, Manner(self._payload))


ATTACKS = (
    Strike("ones-1", "64 KiB of `1` lines, 1 client", Lines(ONES)),
    Strike("ones-16", "64 KiB of `1` lines, 16 clients", Lines(ONES, 16)),
    Strike("ones-50", "64 KiB of `1` lines, 50 clients", Lines(ONES, 50)),
    Strike("newlines", "nothing but newlines, 4 clients", Lines(NEWLINES, 4)),
    Strike("long-line", "lines of 10 MB", Lines(LONG)),
    Strike("nested", f"lines nested {DEPTH} deep, 4 clients", Lines(NESTED, 4)),
    Strike("stops", "2 MB of stops, again and again", Lines(STOPS)),
    Strike("odd-numbers", "keys twice, 200 digits, NaN, 1e999; 4 clients", Lines(ODD, 4)),
)
