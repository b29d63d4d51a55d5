"""`gwrms reset`: ends a held stop."""

import contextlib
from collections.abc import Sequence

from gateway.amounts import NONE
from gateway.cli.connect import ask, connect, parser
from gateway.cli.text import say, say_json, table, warn
from gateway.client import ClientError, RemoteError, Robot
from gateway.wire.component import ChannelInfo
from gateway.wire.framing import ErrorKind
from gateway.wire.robot import Description
from gateway.wire.stop import Reset

EPILOG = """Each drive is taken to "switch on disabled": a moving one is stopped first, a fault is reset, and
one that held its position releases it. Nothing is enabled: the controller or gwrms enable does
that. The stop stays held until every drive is known to be without current, and every controller
to be stopped; otherwise the reason is named. Where no stop is held and drives are under power, or one's
state is not known, the command asks first: they lose their power."""
LOSES = (
    "no stop is held, and under power, or not known, are: {}. A reset stops them and takes their power, "
    "and a wearer the robot's support. Go on?"
)
NOT_KNOWN = "{} (not known)"
POWERED = frozenset({"switched on", "operation enabled", "quick stop active", "fault reaction active"})


def main(argv: list[str]) -> int:
    """Run `gwrms reset`; 0 only when no stop is held any more and every drive is where it should be."""
    made = parser("reset", "End a held stop: every drive switched off, none enabled.", EPILOG)
    made.add_argument(
        "--yes", action="store_true", help="do not ask where no stop is held and drives are under power"
    )
    arguments = made.parse_args(argv)
    with connect(arguments, "reset") as robot:
        if not arguments.yes and (powered := _powered(robot)):
            if not ask(LOSES.format(", ".join(powered)), yes=False):
                warn("reset", "nothing was done")
                return 1
            if _is_stopped(robot):
                warn("reset", "somebody has stopped the robot meanwhile: nothing was done")
                return 1
        reset = robot.reset()
    if arguments.json:
        say_json(reset)
    else:
        say(_text(reset))
    return _verdict(reset)


def _powered(robot: Robot) -> list[str]:
    """Return the drives that may hold their joint while no stop is held, as far as the robot tells.

    A drive whose state it does not tell is one of them.

    Raises:
        RemoteError: of a robot that is not served, and why.

    """
    try:
        description = robot.describe()
    except ClientError as error:
        if isinstance(error, RemoteError) and error.kind == ErrorKind.UNAVAILABLE:
            raise
        return [NOT_KNOWN.format("every drive")]
    return [] if description.stop.held else _with_power(robot, description)


def _is_stopped(robot: Robot) -> bool:
    """Return whether a stop is held, as far as the robot tells."""
    with contextlib.suppress(ClientError):
        return robot.describe().stop.held
    return False


def _with_power(robot: Robot, description: Description) -> list[str]:
    joints = [one.name for one in description.components if one.kind == "joint"]
    states = {one.component: one for one in description.channels if one.quantity == "state"}
    words = _words(robot, [states[joint] for joint in joints if joint in states])
    found = ((joint, words.get(joint)) for joint in joints)
    return [
        joint if word else NOT_KNOWN.format(joint) for joint, word in found if not word or word in POWERED
    ]


def _words(robot: Robot, states: Sequence[ChannelInfo]) -> dict[str, str | None]:
    """Return the drives' states in words; of none where the robot does not tell them."""
    with contextlib.suppress(ClientError):
        values = robot.components(*(one.name for one in states)).values if states else {}
        return {one.component: _word(one, values.get(one.name)) for one in states}
    return {}


def _word(channel: ChannelInfo, value: float | None) -> str | None:
    return channel.enum.get(f"{value:.0f}") if value is not None and channel.enum else None


def _text(reset: Reset) -> str:
    rows = [(name, state, reset.problems.get(name, "")) for name, state in reset.drives.items()]
    rows += [(name, NONE, why) for name, why in reset.problems.items() if name not in reset.drives]
    held = "The stop is STILL HELD." if reset.held else "No stop is held."
    return table(("OF", "STATE", "PROBLEM"), rows) + f"\n{held}\n"


def _verdict(reset: Reset) -> int:
    if reset.problems:
        what = "the stop is still held" if reset.held else "no stop is held, but see"
        warn("reset", f"{what}: {', '.join(reset.problems)}")
    return 1 if reset.held or reset.problems else 0
