"""`gwrms store`: a device keeps its parameters over a reset."""

from gateway.cli.connect import connect
from gateway.cli.storage import device_parser, say_stored

EPILOG = """Refused while one of its drives is enabled or in a state that is not known, while something
is on trial, and where the device does not say that it can (1010h). All of its parameters are stored, whoever
has changed them, and compared before and after. A write never stores by itself.

example:
  gwrms store left_knee"""


def main(argv: list[str]) -> int:
    """Run `gwrms store`."""
    made = device_parser("store", "Make a device keep its parameters as they are now (1010h).", EPILOG)
    arguments = made.parse_args(argv)
    with connect(arguments, "store") as robot:
        stored = robot.store(arguments.component)
    say_stored(stored, json=arguments.json)
    return 0
