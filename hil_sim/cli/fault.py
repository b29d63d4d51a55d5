"""`gwrms sim-fault`: inject faults into a running simulated robot, and mend it again."""

import argparse
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from hil_sim.control_socket import ask
from hil_sim.faults.fault import FaultTarget
from hil_sim.faults.registry import FAULTS
from hil_sim.operator import VERBS

_DESCRIPTION = """\
Make a fault in the robot of a running `gwrms sim --dir DIR`, or end it. Without --for it stays until it is
cleared. --list explains every fault and its parameters.
"""

_EPILOG = """\
examples
  gwrms sim-fault --list
  gwrms sim-fault --dir /tmp/robot node_lost --on left_knee --for 5
  gwrms sim-fault --dir /tmp/robot bus_load percent=100 cob_id=0x100
  gwrms sim-fault --dir /tmp/robot --active
  gwrms sim-fault --dir /tmp/robot --clear bus_load
  gwrms sim-fault --dir /tmp/robot --clear all
  gwrms sim-fault --dir /tmp/robot --activity sit
  gwrms sim-fault --dir /tmp/robot --controller start     after a stop or a fault has made it wait

from a program
  The socket DIR/control takes a line of JSON and answers with one: {"fault": "node_lost", "on": "left_knee",
  "for_s": 5}, {"fault": "bus_load", "params": {"percent": 100}}, {"clear": "all"}, {"activity": "sit"},
  {"controller": "start"}, {"list": true}. The last one lists every fault with its possible devices, its keys
  and where it is active ("faults"), and the active ones with start and settings ("active").

exit status: 0 done; 1 refused, or no simulator runs in DIR; 2 wrong usage
"""


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="gwrms sim-fault",
        description=_DESCRIPTION,
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--dir", type=Path, metavar="DIR", help="folder of the simulator")
    parser.add_argument("name", nargs="?", metavar="NAME", help="the fault")
    parser.add_argument("params", nargs="*", metavar="KEY=VALUE", help="its parameters")
    parser.add_argument("--on", metavar="DEVICE", help="the device, if there are several")
    parser.add_argument(
        "--for", dest="for_s", type=float, metavar="S", help="end it after S simulated seconds"
    )
    others = parser.add_mutually_exclusive_group()
    others.add_argument("--list", action="store_true", help="explain every fault")
    others.add_argument("--active", action="store_true", help="show active faults")
    others.add_argument("--clear", metavar="NAME", help="end a fault, or all")
    others.add_argument("--activity", metavar="WHAT", help="change the wearer's activity")
    others.add_argument("--controller", metavar="WHAT", help="start or stop the gait controller")
    others.add_argument("--hand", metavar="JOINT=DEGREES", help="move a joint without power by hand")
    others.add_argument(
        "--lean", type=float, nargs=2, metavar=("FORWARD", "LEFT"), help="lean the trunk, in degrees"
    )
    others.add_argument("--stamp", metavar="FOOT", help="stamp with the left or right foot, or nobody")
    return parser


def main(argv: list[str]) -> int:
    """Ask the simulator; returns the exit status."""
    parser = _parser()
    try:
        arguments = parser.parse_intermixed_args(argv)
        if arguments.list:
            sys.stdout.write(explained())
            return 0
        request = _request(parser, arguments)
    except SystemExit as leave:
        return 2 if leave.code else 0
    sys.stdout.write(_told(ask(arguments.dir, request)))
    return 0


def _request(parser: argparse.ArgumentParser, arguments: argparse.Namespace) -> dict[str, Any]:
    """Return the request for the socket; exit with the usage if there is none."""
    if arguments.dir is None:
        parser.error("--dir DIR says which simulator")
    given: dict[str, Any] = {
        "fault": arguments.name,
        "clear": arguments.clear,
        "activity": arguments.activity,
        "controller": arguments.controller,
        "list": arguments.active or None,
        "on": arguments.on,
        "for_s": arguments.for_s,
        "params": _params(parser, arguments.params) or None,
        "lean": arguments.lean,
        "stamp": arguments.stamp,
        **_hand(parser, arguments.hand),
    }
    if not any(given.get(verb) for verb in VERBS):
        parser.error("name a fault, or say what else: --help lists it")
    return {key: value for key, value in given.items() if value is not None}


def _hand(parser: argparse.ArgumentParser, word: str | None) -> dict[str, Any]:
    if word is None:
        return {}
    joint, _, degrees = word.partition("=")
    try:
        return {"hand": joint, "degrees": float(degrees)}
    except ValueError:
        parser.error(f"--hand {word!r} is not JOINT=DEGREES, as left_knee=30")


def _params(parser: argparse.ArgumentParser, words: list[str]) -> dict[str, str]:
    params = {}
    for word in words:
        key, equals, params[key] = word.partition("=")
        if not equals:
            parser.error(f"{word!r} is no parameter: write KEY=VALUE")
    return params


def _told(answer: dict[str, Any]) -> str:
    """Return an answer in words."""
    if "begun" in answer:
        return f"begun: {_active(answer['begun'])}\n"
    for key in ("cleared", "active"):
        if key in answer:
            told, none = (_cleared, "nothing was cleared") if key == "cleared" else (_active, "nothing is on")
            return "".join(f"{line}\n" for line in map(told, answer[key])) or f"{none}\n"
    return "".join(f"{key}: {value}\n" for key, value in answer.items())


def _cleared(one: dict[str, Any]) -> str:
    return f"cleared: {one['name']} on {one['on']}"


def _active(one: dict[str, Any]) -> str:
    parameters = FAULTS[one["name"]].parameters
    values = "".join(f", {key} {parameters[key].show(value)}" for key, value in one["values"].items())
    until = "until it is cleared" if one["until_s"] is None else f"to {one['until_s']:.1f} s"
    return f"{one['name']} on {one['on']} from {one['since_s']:.1f} s {until}{values}"


def explained() -> str:
    """Return every fault by what it can be on: what it looks like, and its parameters with their defaults."""
    return "\n".join(text for target in FaultTarget for text in (_heading(target), *_explained(target)))


def _heading(target: FaultTarget) -> str:
    return f"-- on {' or '.join((', '.join(target.value[:-1]), target.value[-1])).removeprefix(' or ')}\n"


def _explained(target: FaultTarget) -> Iterator[str]:
    for name, fault in FAULTS.items():
        if fault.on is target:
            lines = [name + " (at once, no duration)" * fault.momentary, f"    {fault.looks}"]
            for key, parameter in fault.parameters.items():
                lines.append(f"    {key}={parameter.show(parameter.default)}: {parameter.what}")
            yield "\n".join(lines) + "\n"
