"""`gwrms gateway`: serves one robot over TCP until SIGINT or SIGTERM."""

import argparse
import gc
import logging
import sys
from collections.abc import Sequence
from pathlib import Path

from msgspec.structs import replace

from gateway import config
from gateway.daemon import Daemon, listen

_DESCRIPTION = """\
Serves one robot over TCP: joints over CANopen, insoles and IMU over serial ports, and
the computer's own CPU, memory and processes.

Nothing runs until a client asks: no bus, no port, no timer is open. What a client asked
for stops linger_s after the last client has left. What is not there is named in
`gwrms describe` and tried again; the rest is served. A [guard] in CONFIG runs from the start.

CONFIG is the robot's file (TOML). `gwrms sim --dir DIR` writes a commented example,
DIR/robot.toml, together with a simulated robot to try it on.
"""
_EPILOG = """\
When ready it prints `listening on HOST:PORT` on standard output. Ask it by hand:
  printf '{"jsonrpc":"2.0","id":1,"method":"component.snapshot"}\\n' | nc 127.0.0.1 7420

SIGINT and SIGTERM end it cleanly. A stop stays held, also over its end and restart: gwrms reset.
Where [guard] heartbeat_ms has armed the drives, they are freed first, and the end is refused
while one is enabled: gwrms stop, then end it.

Anybody who can connect can stop the robot and change its parameters: listen on
127.0.0.1, or on a network of which you know every computer.

exit codes: 0 ended by a signal; 1 the address cannot be used, or CONFIG is wrong; 2 usage
"""


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="gwrms gateway",
        description=_DESCRIPTION,
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("config", metavar="CONFIG", type=Path, help="the robot's file")
    parser.add_argument("--host", help="address to listen on instead of [gateway] host")
    parser.add_argument("--port", type=_port, help="port instead of [gateway] port; 0 picks a free one")
    return parser


def _port(text: str) -> int:
    if not text.isdecimal() or int(text) > 65535:
        raise argparse.ArgumentTypeError(f"{text!r} is no port; allowed are 0 to 65535")
    return int(text)


def main(arguments: Sequence[str]) -> int:
    """Serve until told to end."""
    try:
        options = _parser().parse_args(list(arguments))
    except SystemExit as ended:  # argparse has said why
        return ended.code if isinstance(ended.code, int) else 2
    logging.basicConfig(level=logging.WARNING, format="%(asctime)s %(levelname)s %(name)s: %(message)s")
    robot = config.load(options.config)
    gateway = robot.gateway
    host = gateway.host if options.host is None else options.host
    port = gateway.port if options.port is None else options.port
    daemon = Daemon(replace(robot, gateway=replace(gateway, host=host, port=port)), listen(host, port))
    gc.freeze()  # what was loaded so far lives as long as the process
    with daemon.end_on_signals():
        daemon.run(ready=lambda: _announce(daemon))
    return 0


def _announce(daemon: Daemon) -> None:
    host, port = daemon.address
    sys.stdout.write(f"listening on {f'[{host}]' if ':' in host else host}:{port}\n")
    sys.stdout.flush()
