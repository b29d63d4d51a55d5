"""`gwrms store` and `gwrms restore`: what a device keeps over a reset."""

from gateway.cli.reach import ask, parser, reach
from gateway.cli.text import say, say_json

STORE_EPILOG = """Refused while one of its drives is enabled or in a state that is not known, while something
is on trial, and where the device does not say that it can (1010h). All of its parameters are stored, whoever
has changed them, and compared before and after. A write never stores by itself.

example:
  gwrms store left_knee"""

RESTORE_EPILOG = """Refused as gwrms store is. The defaults act after the device's next reset: switch it off
and on.

example:
  gwrms restore left_knee"""


def store(argv: list[str]) -> int:
    """Run `gwrms store`."""
    made = parser("store", "Make a device keep its parameters as they are now (1010h).", STORE_EPILOG)
    made.add_argument("component", metavar="COMPONENT", help="a joint or device, such as left_knee")
    arguments = made.parse_args(argv)
    with reach(arguments, "store") as robot:
        stored = robot.store(arguments.component)
    say_json(stored) if arguments.json else say(f"{stored.component}: {stored.result}\n")
    return 0


def restore(argv: list[str]) -> int:
    """Run `gwrms restore`."""
    made = parser("restore", "Give a device its defaults back (1011h).", RESTORE_EPILOG)
    made.add_argument("component", metavar="COMPONENT", help="a joint or device, such as left_knee")
    made.add_argument("--yes", action="store_true", help="do not ask")
    arguments = made.parse_args(argv)
    with reach(arguments, "restore") as robot:
        question = f"{arguments.component} loses what was stored in it, and takes its defaults. Go on?"
        if not ask(question, yes=arguments.yes):
            return 1
        restored = robot.restore(arguments.component)
    say_json(restored) if arguments.json else say(f"{restored.component}: {restored.result}\n")
    return 0
