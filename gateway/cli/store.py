"""`gwrms store`: a device keeps its parameters over a reset; or every device does, one after another."""

import argparse

from msgspec import Struct

from gateway.cli.connect import connect, parser
from gateway.cli.storage import add_component, say_stored
from gateway.cli.text import say, say_json, table
from gateway.client import CallTimeout, LinkLost, NotConnected, RemoteError, Robot
from gateway.several_joints import StoreOutcome, refused_or_unknown, storing

EPILOG = """Refused while one of its drives is enabled or in an unknown state, while something is on trial,
and if the device does not report that it can store (1010h). All of its parameters are stored, whoever changed
them, and compared before and after. A write never stores by itself.

With --all every device that can store is asked, one after another, and the outcome of each is printed:
stored, refused, or not confirmed (the contents of its flash are then unknown). If the link drops, the
remaining devices are not asked. Exit status 1 unless all have stored.

examples:
  gwrms store left_knee
  gwrms store --all"""


class StoreResult(Struct, frozen=True):
    """Result of one device; `said` is its own words, or the reason of a failure."""

    components: tuple[str, ...]
    outcome: StoreOutcome
    said: str


def main(argv: list[str]) -> int:
    """Run `gwrms store`."""
    made = parser("store", "Store a device's present parameters in its memory (1010h).", EPILOG)
    add_component(made, "?")
    made.add_argument("--all", action="store_true", help="every device that can store, one after another")
    arguments = made.parse_args(argv)
    if arguments.all == (arguments.component is not None):
        made.error("name one COMPONENT, or say --all")
    with connect(arguments, "store") as robot:
        if arguments.all:
            return _all(robot, arguments)
        stored = robot.store(arguments.component)
    say_stored(stored, json=arguments.json)
    return 0


def _all(robot: Robot, arguments: argparse.Namespace) -> int:
    results: list[StoreResult] = []
    lost = ""
    for components in storing(robot.describe()):
        try:
            outcome, said = (StoreOutcome.UNASKED, lost) if lost else _one(robot, components)
        except NotConnected as error:
            outcome, said = StoreOutcome.UNASKED, str(error)
            lost = said
        except (LinkLost, CallTimeout) as error:
            outcome, said = StoreOutcome.UNKNOWN, str(error)
            lost = said
        results.append(StoreResult(components, outcome, said))
    if arguments.json:
        say_json(results)
    elif results:
        rows = [(" + ".join(one.components), one.outcome, one.said) for one in results]
        say(table(("DEVICE", "", ""), rows))
    else:
        say("no device of this robot says that it can store (1010h)\n")
    return 0 if results and all(one.outcome is StoreOutcome.STORED for one in results) else 1


def _one(robot: Robot, components: tuple[str, ...]) -> tuple[StoreOutcome, str]:
    try:
        return StoreOutcome.STORED, robot.store(components[0]).result
    except RemoteError as error:
        return refused_or_unknown(error.kind), str(error)
