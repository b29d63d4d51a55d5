"""`gwrms gateway`: serves one robot over TCP until it is told to end, and rests while nobody asks."""

import argparse
import contextlib
import dataclasses
import gc
import logging
import os
import signal
import socket
import sys
from collections.abc import Sequence
from pathlib import Path

from msgspec.structs import replace

from gateway import config
from gateway.access.folder import AccessFolder
from gateway.certificates import KeyProblem
from gateway.connections.listener_kind import UnsafeListener, is_loopback
from gateway.connections.listeners import Listeners, default_socket, inherited, listen, listen_locally, rest
from gateway.daemon import Daemon
from gateway.own_folders import given_for_socket, make_safe, to_serve_in
from gateway.process import systemd_notify
from gateway.process.memory import share_heap
from gateway.process.resting import ENDING
from gateway.tables.finding import Finding
from gateway.wire import framing

log = logging.getLogger(__name__)

MOST_KEPT = 100_000  # bytes of the robot's file as it was valid last; Linux takes 128 KiB
NOT_KEPT = "%s is larger than %d bytes: should it be broken while the gateway rests, stops are refused, too"
_VALID = "GWRMS_VALID_FILE"  # where it is in the environment while the gateway rests

_DESCRIPTION = """\
Serves one robot over TCP: joints over CANopen, insoles and IMU over serial ports, and
the computer's own CPU, memory and processes.

Nothing runs until a client asks: no bus, no port, no timer is open. What a client asked
for stops linger_s after the last client has left, and the gateway then becomes a small process
that waits at its port. CONFIG is read at the start, and again when a client wakes the gateway
from that rest; host, port, socket and keys are taken at a start only. What is not there is
named in `gwrms describe` and tried again, the rest is served; a device's file that cannot be
used is told in the log, too. A [guard] in CONFIG runs from the start and for ever, and so does
what a held stop or a trial needs.

CONFIG is the robot's file (TOML). `gwrms sim --dir DIR` writes a commented example,
DIR/robot.toml, together with a simulated robot to try it on.
"""
_EPILOG = """\
When ready it prints `listening on HOST:PORT` on standard output. Ask it by hand:
  printf '{"jsonrpc":"2.0","id":1,"method":"component.snapshot"}\\n' | nc 127.0.0.1 7420

SIGINT and SIGTERM end it cleanly. A stop stays held, also over its end and restart: gwrms reset.
Where [guard] heartbeat_ms has armed the drives, they are freed first, and the end is refused
while one is enabled: gwrms stop, then end it.

Without keys it serves this computer only, and does not start where host is open to others.
`gwrms keys pair CONFIG` makes keys with the first desk: from the gateway's next start on every TCP
connection is TLS, and lets in only whose key is known; accounts of this computer then come by its
Unix socket, which commands without --robot find (gwrms docs pair).

exit status: 0 ended by a signal; 1 the address cannot be used, or CONFIG is wrong; 2 usage
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
    handed, kept = inherited(os.environ), os.environ.pop(_VALID, "")
    by_hand, watched = handed is None or handed.woken, systemd_notify.watchdog_s()
    try:
        robot, text = _robot(options, tell=handed is None or not handed.woken)
        sockets, daemon = _served(robot, handed, ends_idle=watched is None)
    except (config.ConfigError, UnsafeListener, KeyProblem, OSError) as error:
        if handed is None:
            raise
        outdated = _robot_of(kept, options, "; ".join(str(error).splitlines()))
        if outdated is None:
            return _refuse(handed, error, kept)
        log.error("%s", error)  # a stop is carried out all the same
        sockets, daemon = _served(outdated, handed, ends_idle=watched is None)
        text = kept
    if watched is not None:
        daemon.repeat(watched / 2, lambda: systemd_notify.tell("WATCHDOG=1"))
    gc.freeze()  # what was loaded so far lives as long as the process
    with daemon.end_on_signals():
        daemon.run(ready=lambda: _announce(daemon, anew=not sockets.woken))
        signal.pthread_sigmask(signal.SIG_BLOCK, ENDING)
        if by_hand and not daemon.told:
            rest(dataclasses.replace(sockets, without_keys=not daemon.has_keys), {_VALID: text})
    return 0


def _served(
    robot: config.RobotConfig, handed: Listeners | None, *, ends_idle: bool
) -> tuple[Listeners, Daemon]:
    """Return the gateway of this robot, and its sockets; where it cannot be, those are closed that are new.

    Raises:
        OSError: a socket cannot be opened.
        UnsafeListener: one must not be served.
        KeyProblem: the robot's key cannot be used.

    """
    share_heap()
    sockets = _listeners(robot, handed)
    try:
        daemon = Daemon(
            robot,
            sockets.port,
            classic=sockets.classic,
            local=sockets.local,
            ends_idle=ends_idle,
            rested_without_keys=sockets.without_keys,
        )
    except (UnsafeListener, KeyProblem):
        for one in sockets.all:
            if handed is None or one not in handed.all:
                one.close()
        raise
    return sockets, daemon


def _robot(options: argparse.Namespace, *, tell: bool) -> tuple[config.RobotConfig, str]:
    """Return the robot of the file, and its text to be kept at rest: a stop needs it where it breaks then.

    What is likely wrong with it, or files that it names, is logged on `tell`.
    """
    data = config.read(options.config)
    robot, warnings = config.load_bytes(options.config, data)
    is_kept = len(data) <= MOST_KEPT
    for one in (*warnings, *_beside(robot)) if tell else ():
        log.warning("%s: %s", options.config, one.words)
    if tell and not is_kept:
        log.warning(NOT_KEPT, options.config, MOST_KEPT)
    return _as_told(robot, options), os.fsdecode(data) if is_kept else ""


def _robot_of(kept: str, options: argparse.Namespace, outdated: str) -> config.RobotConfig | None:
    """Return the robot of a kept text, and why it is `outdated`; None where there is none."""
    if not kept:
        return None
    try:
        robot, _warnings = config.load_bytes(options.config, os.fsencode(kept))
    except config.ConfigError:  # of another version of the program
        return None
    told = _as_told(robot, options)  # without what is refused anyway, and needs a socket
    return replace(told, gateway=replace(told.gateway, classic_port=None), outdated=outdated)


def _as_told(robot: config.RobotConfig, options: argparse.Namespace) -> config.RobotConfig:
    """Return it with what the command line says otherwise."""
    given = {"host": options.host, "port": options.port}
    changed = {key: value for key, value in given.items() if value is not None}
    return replace(robot, gateway=replace(robot.gateway, **changed))


def _beside(robot: config.RobotConfig) -> list[Finding]:
    """Return the findings about EDS files, layouts and calibrations: each costs only a component."""
    from gateway.prerequisites import beside  # all that drivers need: not for a gateway that wakes for a stop

    found = list(beside(robot))
    gc.collect()  # buses and components that were built to be looked at
    return found


def _listeners(robot: config.RobotConfig, handed: Listeners | None) -> Listeners:
    """Those that were handed over; what is missing is opened."""
    gateway, where = robot.gateway, f"[gateway] of {robot.path}:"
    ours = f"{where} host and port, or --host and --port"
    port = listen(gateway.host, gateway.port, ours) if handed is None else handed.port
    classic = None if handed is None else handed.classic
    if classic is None and gateway.classic_port is not None:
        try:
            classic = listen(gateway.host, gateway.classic_port, f"{where} classic_port")
        except OSError:
            if handed is None:
                port.close()
            raise
    if handed is None:
        return Listeners(port, classic, _local(robot))
    is_settled = handed.woken or handed.local is not None
    return dataclasses.replace(handed, classic=classic, local=handed.local if is_settled else _local(robot))


def _local(robot: config.RobotConfig) -> socket.socket | None:
    """Return the Unix socket that the robot's file names, or one in a folder that is given for such.

    With keys it is the only way in for this computer's accounts, a stop's too: there is always one.
    """
    given = robot.gateway.socket
    if given is not None:
        return listen_locally(robot.path.parent / given) if given else None
    folder, problems = given_for_socket(os.environ), []
    folders = [] if folder is None else [folder]
    for one in to_serve_in(os.environ) if AccessFolder(robot.access).has_keys else folders:
        try:
            make_safe(one)
            return listen_locally(default_socket(one, robot.robot.name))
        except OSError as error:  # nobody has asked for it here
            problems.append(str(error))
    if problems:
        log.warning("no Unix socket for this computer's accounts: %s", "; ".join(problems))
    return None


def _refuse(handed: Listeners, error: Exception, kept: str) -> int:
    """Tell everybody who has come from this computer why they are not served; where it was woken, rest again.

    Whoever comes from elsewhere is told nothing: nobody knows who that is.
    """
    log.error("%s", error)
    line = framing.encode_error(None, framing.refuse(framing.ErrorKind.UNAVAILABLE, str(error)))
    for listener in handed.all:
        listener.setblocking(False)
        with contextlib.suppress(BlockingIOError):
            while True:
                connection, _ = listener.accept()
                with connection, contextlib.suppress(OSError):
                    if listener.family == socket.AF_UNIX or is_loopback(listener.getsockname()):
                        connection.send(line)
    if handed.woken:
        rest(handed, {_VALID: kept})
    return 1


def _announce(daemon: Daemon, *, anew: bool) -> None:
    systemd_notify.tell("READY=1")
    if anew:
        host, port = daemon.address
        sys.stdout.write(f"listening on {f'[{host}]' if ':' in host else host}:{port}\n")
        sys.stdout.flush()
