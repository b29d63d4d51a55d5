"""`gwrms sessions resources | compare`: what programs on a robot took, and what takes more than it did."""

from collections.abc import Iterator

from gateway.amounts import NONE, counted, size
from gateway.cli.text import say, say_json, table
from ml.store.sessions import Session
from ml.store.tables import RESOURCES
from server_gui.cli.cloud_options import add_url, parser, recordings
from server_gui.core.cloud.recordings import Recordings
from server_gui.core.processing.recorded_use import Looks, ProgramUse, looks, used
from server_gui.core.processing.regression import Regression, SessionUse, regressions

HEADER = ("PROCESS", "CPU", "MEMORY", "AT MOST", "GROWTH AN HOUR")
RESOURCES_EPILOG = """Programs that never had memory or CPU when looked at, such as most threads of the
kernel, are left out and counted; --all shows them, and --json always has them."""
COMPARE_EPILOG = """Separate several sessions on a side by commas: with only one, the effect of a version
cannot be separated from that of the day. A process is named if its median over the minutes is a tenth more,
and at least 1 % of a core or 2 MiB, if three quarters of the sessions after lie above three quarters of
those before, and if chance is ruled out (rank-sum test, p < 0.01 over all comparisons together).

example
  gwrms sessions compare 20261119T09,20261120T09 20261121T09,20261122T09

exit status
  0 nothing takes more; 1 something does, or it failed; 2 usage"""


def resources(argv: list[str]) -> int:
    """Run `gwrms sessions resources`."""
    made = parser(
        "sessions resources",
        "Show the resources used by each program on the robot's computer, and memory leaks.",
        RESOURCES_EPILOG,
    )
    made.add_argument("session", metavar="SESSION", help="its name, which may be abbreviated")
    made.add_argument("--all", action="store_true", help="include programs that used nothing")
    add_url(made)
    arguments = made.parse_args(argv)
    known = recordings("sessions", arguments)
    found = used(_looks(known, known.find(arguments.session)))
    if arguments.json:
        say_json(found)
        return 0
    shown = [use for use in found if arguments.all or not use.idle]
    say(table(HEADER, map(_row, shown), right=(1, 2, 3, 4)))
    if len(shown) < len(found):
        left_out = counted(len(found) - len(shown), "program")
        say(f"{left_out} left out that never used anything, as most threads of the kernel: --all\n")
    return 0


def compare(argv: list[str]) -> int:
    """Run `gwrms sessions compare`."""
    made = parser(
        "sessions compare", "Find programs that use more resources than in earlier sessions.", COMPARE_EPILOG
    )
    made.add_argument(
        "before", metavar="BEFORE[,…]", help="sessions by their names, which may be abbreviated"
    )
    made.add_argument("after", metavar="AFTER[,…]", help="the same, of another version")
    add_url(made)
    arguments = made.parse_args(argv)
    known = recordings("sessions", arguments)
    sides = [[_use(known, name) for name in side.split(",")] for side in (arguments.before, arguments.after)]
    found = regressions(*sides)
    if arguments.json:
        say_json(found)
    else:
        say("\n".join(_told(sides, found)) + "\n")
    return 1 if found else 0


def _use(known: Recordings, name: str) -> SessionUse:
    session = known.find(name)
    return SessionUse.of(_version(session), _looks(known, session))


def _version(session: Session) -> str:
    """Return the name of a session's software: the gateway's version, else the session's own name."""
    known = session.versions.get("gateway")
    return f"gateway {known}" if known else session.session


def _looks(known: Recordings, session: Session) -> Looks:
    return looks(known.rows_of(session, RESOURCES))


def _told(sides: list[list[SessionUse]], found: list[Regression]) -> Iterator[str]:
    minutes = [sum(use.minutes for use in side) for side in sides]
    yield f"compared: {minutes[0]} minutes before, {minutes[1]} after"
    yield from (regression.text for regression in found)
    if not found:
        yield "nothing surely takes more"


def _row(use: ProgramUse) -> tuple[str, ...]:
    return (
        use.name,
        NONE if use.cpu_percent is None else f"{use.cpu_percent:.1f} %",
        size(use.memory_bytes),
        size(use.most_bytes),
        "" if use.leak is None else f"{use.leak.value / (1 << 20):+.1f} MiB, leaks",
    )
