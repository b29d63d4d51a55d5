"""Child of the simulator's benchmark: sends a SYNC's message each period and does nothing else.

`python -m tests.bench._ticker PORT HZ SECONDS`; how evenly it comes is what this computer can do.
"""

import select
import socket
import sys
import time


def main() -> None:
    port, hz, seconds = int(sys.argv[1]), int(sys.argv[2]), float(sys.argv[3])
    with socket.create_connection(("127.0.0.1", port)) as wire:
        wire.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        began_s = time.monotonic()
        for number in range(1, round(seconds * hz)):
            select.select([], [], [], max(0.0, began_s + number / hz - time.monotonic()))
            wire.sendall(b"< frame 080 0.000000  >")


if __name__ == "__main__":
    main()
