"""`gwrms enable`: enables drives, as the master of a bench."""

from gateway.amounts import NONE
from gateway.cli.connect import connect, parser
from gateway.cli.text import say, say_json, table, warn
from gateway.wire.stop import Enabled

EPILOG = """Only where the gateway is the bus's master ([gateway] role = "master"), and while no stop is held.
All drives make one transition, each confirms it, then the next; before the last one the setpoint is
set to one that moves nothing. Any interruption ends it: drives already affected are stopped.

The joints have torque afterwards: keep the hardware stop within reach.

example:
  gwrms enable left_knee"""


def main(argv: list[str]) -> int:
    """Run `gwrms enable`; 0 only when every chosen drive is enabled."""
    made = parser("enable", "Enable drives, one confirmed transition at a time.", EPILOG)
    made.add_argument("joints", metavar="JOINT", nargs="*", help="names or globs (default: all)")
    arguments = made.parse_args(argv)
    with connect(arguments, "enable") as robot:
        enabled = robot.enable(*arguments.joints)
    if arguments.json:
        say_json(enabled)
    else:
        say(_text(enabled))
    if enabled.problems:
        warn("enable", f"NOT ENABLED, and stopped again: {', '.join(enabled.problems)}")
    return 1 if enabled.problems else 0


def _text(enabled: Enabled) -> str:
    rows = [
        (name, state, enabled.modes.get(name, NONE), enabled.problems.get(name, ""))
        for name, state in enabled.drives.items()
    ]
    return table(("DRIVE", "STATE", "MODE", "PROBLEM"), rows)
