"""`gwrms restore`: a device gets its defaults back."""

from gateway.cli.connect import ask, connect
from gateway.cli.storage import device_parser, say_stored
from gateway.cli.text import warn

EPILOG = """Refused in the same cases as gwrms store. The defaults take effect after the device's next
reset: switch it off and on.

example:
  gwrms restore left_knee"""


def main(argv: list[str]) -> int:
    """Run `gwrms restore`."""
    made = device_parser("restore", "Restore a device's defaults (1011h).", EPILOG)
    made.add_argument("--yes", action="store_true", help="do not ask for confirmation")
    arguments = made.parse_args(argv)
    with connect(arguments, "restore") as robot:
        question = f"{arguments.component} loses what was stored in it, and takes its defaults. Go on?"
        if not ask(question, yes=arguments.yes):
            warn("restore", "nothing was restored")
            return 1
        restored = robot.restore(arguments.component)
    say_stored(restored, json=arguments.json)
    return 0
