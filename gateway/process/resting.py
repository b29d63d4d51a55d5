"""A gateway at rest: a bare interpreter that sleeps at its sockets until a client comes.

Run as a script, without site-packages, with the gateway's own command line as arguments
(`connections/listeners.py` does both ways). It imports next to nothing, so that it stays as small as Python
can be, and it never accepts: who comes waits in the socket's backlog and is served by the gateway that this
becomes.
"""

import os
import select
import signal
import sys

FIRST = 3  # the first descriptor that is handed over (sd_listen_fds(3))
ENDING = (signal.SIGINT, signal.SIGTERM)


def main() -> None:
    """Sleep in one system call, then become the gateway again."""
    for number in ENDING:
        signal.signal(number, lambda _number, _frame: os._exit(0))
    signal.pthread_sigmask(signal.SIG_UNBLOCK, ENDING)
    select.select(range(FIRST, FIRST + int(os.environ["LISTEN_FDS"])), [], [])
    # What comes from here on is for the gateway, as soon as it can take it.
    signal.pthread_sigmask(signal.SIG_BLOCK, ENDING)
    os.execv(sys.argv[1], sys.argv[1:])


if __name__ == "__main__":
    main()
