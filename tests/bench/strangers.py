"""Strangers who begin 200 handshakes a second until they are told to end, and say how many it were."""

import signal
import sys
import time
from types import FrameType

from tests.unit.gateway import keyed as keys

A_SECOND = 200


class _Over(Exception):
    """Somebody has told us to end."""


def _end(_signal: int, _frame: FrameType | None) -> None:
    raise _Over


def main(host: str, port: str) -> None:
    """Knock."""
    context, knocked, began_s = keys.context(keys.pair("stranger")), 0, time.monotonic()
    signal.signal(signal.SIGTERM, _end)
    sys.stdout.write("they come\n")
    sys.stdout.flush()
    try:
        while True:
            try:
                with keys.raw((host, int(port))) as bare, context.wrap_socket(bare) as secured:
                    secured.recv(1)
            except OSError:
                pass
            knocked += 1
            time.sleep(max(0.0, began_s + knocked / A_SECOND - time.monotonic()))
    except _Over:
        sys.stdout.write(str(knocked))


main(*sys.argv[1:])
