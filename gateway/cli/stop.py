"""`gwrms stop`: quick stop on every drive."""

from gateway.cli.connect import again, connect, parser, spoken
from gateway.cli.text import say, say_json, table, warn
from gateway.client import ClientError
from gateway.wire.stop import Stopped

WARNING = (
    "This is a software stop over the network, not a safety-rated stop: keep the hardware one within reach."
)


def main(argv: list[str]) -> int:
    """Run `gwrms stop`; 0 only when every drive has confirmed."""
    made = parser(
        "stop",
        "Quick stop on every drive, held until gwrms reset. Needs no lease.\n"
        "Exit status 0 only when every drive has confirmed, and every controller of the robot's file.",
        WARNING,
    )
    made.add_argument("--reason", default="gwrms stop", help="reason for the robot's journal")
    arguments = made.parse_args(argv)
    try:
        with connect(arguments, "stop") as robot:
            stopped = robot.stop(arguments.reason)
    except ClientError as error:
        warn("stop", f"NOT CONFIRMED, assume that {spoken(arguments)} still moves. {error}")
        return 1
    if arguments.json:
        say_json(stopped)
    else:
        say(_text(stopped, again(arguments, "reset")))
    return _verdict(stopped)


def _text(stopped: Stopped, reset: str) -> str:
    outcomes = {**stopped.drives, **stopped.controllers}
    rows = [(name, outcome, stopped.fallbacks.get(name, "")) for name, outcome in outcomes.items()]
    held = f"The stop is held until it is reset ({reset}).\n" if stopped.held else ""
    title = "DRIVE OR CONTROLLER" if stopped.controllers else "DRIVE"
    return table((title, "STOP", ""), rows) + f"\n{held}{WARNING}\n"


def _verdict(stopped: Stopped) -> int:
    outcomes = {**stopped.drives, **stopped.controllers}
    missing = [name for name, outcome in outcomes.items() if outcome != "confirmed"]
    if not stopped.drives:
        warn("stop", "NOT CONFIRMED: the robot has no drive that can be stopped")
    elif missing:
        who = "it still moves" if len(missing) == 1 else "they still move"
        warn("stop", f"NOT CONFIRMED by {', '.join(missing)}: assume that {who}")
    for said in filter(None, (stopped.outdated, stopped.problem)):
        warn("stop", said)
    return 0 if stopped.drives and not missing and stopped.outdated is None else 1
