"""A device's object dictionary as a gateway tells it, and what the device holds."""

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from gateway.wire.dictionary import ObjectInfo, ObjectList, ObjectValue, ObjectValues
from gateway.wire.method import Number
from tests.support.desk import FakeCommands

MOST = 256  # objects of one answer of a gateway


def one(
    address: str,
    name: str,
    type_: str = "UNSIGNED16",
    access: str = "rw",
    default: Number | str | None = None,
    **more: object,
) -> ObjectInfo:
    """An object that is no parameter, unless `more` says so."""
    locked = {"read_only": "no parameter", "locked": "it is no parameter", "parameter": None}
    limits = {"min": None, "max": None}
    return ObjectInfo(address, name, type_, access, default=default, **{**limits, **locked, **more})  # type: ignore[arg-type]


RELEASE = '[joint.left_knee]\nrelease = ["following_error_window"]'
OBJECTS = (
    one("0x1000:0", "Device type", "UNSIGNED32", "ro", 0x20192),
    one("0x1008:0", "Manufacturer device name", "VISIBLE_STRING", "const"),
    one("0x1018:4", "Identity object.Serial number", "UNSIGNED32", "ro"),
    one("0x2000:1", "Trace.Data", "DOMAIN", "ro"),
    one("0x2001:0", "Operating time", "UNSIGNED64", "ro"),
    one("0x6040:0", "Controlword", pdos=["RPDO1"], default=0, read_only="controlword"),
    one("0x6041:0", "Statusword", access="ro", pdos=["TPDO1"], read_only="ro in the EDS"),
    one(
        "0x6065:0",
        "Following error window",
        "UNSIGNED32",
        default=5000,
        parameter="left_knee.following_error_window",
        read_only="not released",
        locked='add "following_error_window" to release in [joint.left_knee] of the robot\'s file',
        release=RELEASE,
    ),
    one(
        "0x6072:0",
        "Max torque",
        default=1000,
        min=0,
        max=5000,
        parameter="left_knee.max_torque",
        read_only=None,
        locked=None,
    ),
)
HOLDS: Mapping[str, ObjectValue] = {
    "0x1000:0": ObjectValue(0x20192, "0x20192", 1),
    "0x1008:0": ObjectValue("GWRMS joint drive", '"GWRMS joint drive"', 1),
    "0x1018:4": ObjectValue(20260002, "0x1352442", 1),
    "0x2000:1": ObjectValue(None, "", None, "a domain is not read: nobody knows how long it would take"),
    "0x2001:0": ObjectValue(2**63 + 1, str(2**63 + 1), 1),
    "0x6040:0": ObjectValue(0x000F, "0x000F", 1),
    "0x6041:0": ObjectValue(0x0237, "0x0237 (operation enabled)", 1),
    "0x6065:0": ObjectValue(4000, "4000", 1),
    "0x6072:0": ObjectValue(80000, "80000", 1),
}


def answer_lists(commands: FakeCommands, objects: Iterable[ObjectInfo] = OBJECTS, most: int = MOST) -> int:
    """Answer every question for lists, also those that follow from an answer; how many there were."""
    known, answered = list(objects), 0
    for place, (name, arguments) in _open(commands, "objects"):
        assert name == "objects"
        first = int(str(arguments[1])[2:-1], 16)
        found = [info for info in known if int(info.object[2:6], 16) >= first]
        told = ObjectList(str(arguments[0]), found[:most], max(0, len(found) - most))
        commands.futures[place].set_result(told)
        answered += 1
    return answered


def answer_reads(commands: FakeCommands, holds: Mapping[str, ObjectValue] = HOLDS) -> int:
    """Answer every question for values; what is not in `holds` holds 0."""
    answered = 0
    for place, (_, arguments) in _open(commands, "read_objects"):
        values = {address: holds.get(address, ObjectValue(0, "0", 1)) for address in arguments[1]}
        commands.futures[place].set_result(ObjectValues(str(arguments[0]), values))
        answered += 1
    return answered


def _open(commands: FakeCommands, name: str) -> Iterator[tuple[int, tuple[str, tuple[Any, ...]]]]:
    """The questions that nobody has answered; answers may bring others, which are among them."""
    place = 0
    while place < len(commands.futures):
        asked = [one for one in commands.asked if one[0] != "show_processes"]  # of which no future is made
        if asked[place][0] == name and not commands.futures[place].done():
            yield place, asked[place]
        place += 1
