"""Objects at the desk: listed once, read while somebody looks, found, compared, told in every notation."""

import time

import pytest
from msgspec.structs import replace

from gateway.client import LinkLost, RemoteError
from gateway.wire.bus import BusInfo, NodeInfo
from gateway.wire.component import ComponentInfo
from gateway.wire.dictionary import ObjectValue
from server_gui.core.desk.desk import Desk
from server_gui.core.follow.events import Described
from server_gui.core.objects.devices import device_of, devices
from server_gui.core.objects.facts import facts
from server_gui.core.objects.forms import for_reading, forms
from server_gui.core.objects.objects import Objects
from server_gui.core.objects.reading import MOST, OLD_S, Reading, ReadValue
from server_gui.core.objects.rows import Compared, Finder, RowKind, cells, channel_lines, limits, pin_of
from tests.support.desk import Bench, FakeCommands, described
from tests.support.dictionaries import HOLDS, OBJECTS, answer_lists, answer_reads, one

KNEE = "left_knee"
BY_ADDRESS = {info.object: info for info in OBJECTS}


@pytest.fixture
def commands() -> FakeCommands:
    return FakeCommands()


@pytest.fixture
def objects(commands: FakeCommands) -> Objects:
    return Objects(commands, lambda call: call())


def _read(objects: Objects, commands: FakeCommands, component: str = KNEE) -> Compared:
    """Everything, at once."""
    reading = objects.reading
    reading.read_once((component, info.object) for info in objects.of(component).objects)
    while reading.left:
        reading._next_ns = 0
        reading.look(())
        answer_reads(commands)
    return Compared(component, reading.held)


# --- listing


def test_nothing_is_asked_before_somebody_looks(objects: Objects, commands: FakeCommands) -> None:
    objects.described(is_another=False)
    objects.reading.look(())
    assert commands.asked == []


@pytest.mark.parametrize("most", [1, 2, 4, 256])
def test_a_dictionary_that_comes_in_parts_is_whole_and_in_order(
    objects: Objects, commands: FakeCommands, most: int
) -> None:
    objects.of(KNEE)
    answer_lists(commands, most=most)
    assert objects.of(KNEE).objects == list(OBJECTS)


def test_an_index_with_all_its_sub_indices_does_not_ask_for_ever(
    objects: Objects, commands: FakeCommands
) -> None:
    whole = [one(f"0x2000:{sub}", f"Entry {sub}") for sub in range(256)]
    objects.of(KNEE)
    asked = answer_lists(commands, [*whole, one("0x2001:0", "Next")])
    assert asked == 2
    assert len(objects.of(KNEE).objects) == 257


def test_a_list_that_goes_back_ends(objects: Objects, commands: FakeCommands) -> None:
    objects.of(KNEE)
    answer_lists(commands, [one("0x1000:0", "Device type"), one("0x1000:0", "Again")], most=1)
    assert len(objects.of(KNEE).objects) == 1


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (RemoteError(-32601, "no such method"), "is of an older version"),
        (RemoteError(-32001, "'trunk' has no object dictionary"), 'name it as eds = "FILE"'),
        (LinkLost("the link dropped"), "could not be asked for: the link dropped"),
    ],
)
def test_a_dictionary_that_is_not_there_says_why_and_how(
    objects: Objects, commands: FakeCommands, error: Exception, said: str
) -> None:
    objects.of(KNEE)
    commands.fail(error)
    assert said in (objects.of(KNEE).problem or "")
    assert len(commands.named("objects")) == 1  # it is asked again some seconds later


def test_an_eds_without_objects_says_how_to_mend_it(objects: Objects, commands: FakeCommands) -> None:
    objects.of(KNEE)
    answer_lists(commands, [])
    assert "gwrms eds FILE" in (objects.of(KNEE).problem or "")


def test_on_another_link_they_are_asked_anew_and_stay_shown_meanwhile(
    objects: Objects, commands: FakeCommands
) -> None:
    objects.of(KNEE)
    answer_lists(commands)
    objects.described(is_another=False)
    assert objects.of(KNEE).objects == list(OBJECTS)
    assert answer_lists(commands) == 1
    objects.described(is_another=True)
    assert objects.of(KNEE).objects == []


# --- reading


def test_one_question_at_a_time_and_not_at_once_again(commands: FakeCommands) -> None:
    reading = Reading(commands, lambda call: call())
    wanted = [(KNEE, "0x6041:0")]
    reading.look(wanted)
    reading._next_ns = 0
    reading.look([(KNEE, "0x1000:0")])  # while the first is under way
    assert len(commands.named("read_objects")) == 1
    answer_reads(commands)
    reading.look(wanted)
    assert len(commands.named("read_objects")) == 1
    reading._next_ns = 0
    reading.look(wanted)  # it is fresh
    assert len(commands.named("read_objects")) == 1
    reading._asked[wanted[0]] -= 2_000_000_000
    reading.look(wanted)
    assert len(commands.named("read_objects")) == 2


def test_the_longest_unread_come_first_and_not_too_many_at_once(commands: FakeCommands) -> None:
    reading = Reading(commands, lambda call: call())
    wanted = [(KNEE, f"0x{index:04X}:0") for index in range(0x2000, 0x2040)]
    reading.look(wanted)
    answer_reads(commands)
    reading._next_ns = 0
    reading.look(wanted)
    first, second = (set(objects) for _, objects in commands.named("read_objects"))
    assert len(first) == len(second) == MOST
    assert not first & second


def test_what_is_in_sight_goes_before_what_is_read_once(commands: FakeCommands) -> None:
    reading = Reading(commands, lambda call: call())
    reading.read_once([(KNEE, "0x1000:0")])
    reading.look([(KNEE, "0x6041:0")])
    assert commands.named("read_objects") == [(KNEE, ("0x6041:0",))]
    answer_reads(commands)
    reading._next_ns = 0
    reading.look([(KNEE, "0x6041:0")])
    assert commands.named("read_objects")[-1] == (KNEE, ("0x1000:0",))
    answer_reads(commands)
    assert not reading.left


def test_a_domain_is_asked_for_once(commands: FakeCommands) -> None:
    reading = Reading(commands, lambda call: call())
    domain = (KNEE, "0x2000:1")
    reading.look([domain], [domain])
    answer_reads(commands)
    reading._next_ns, reading._asked[domain] = 0, 0
    reading.look([domain], [domain])
    assert len(commands.named("read_objects")) == 1


def test_what_was_read_stays_with_its_age_when_the_link_goes(commands: FakeCommands) -> None:
    reading = Reading(commands, lambda call: call())
    wanted = [(KNEE, "0x6041:0")]
    reading.look(wanted)
    answer_reads(commands)
    reading._next_ns = 0
    reading._asked.clear()
    reading.look(wanted)
    commands.fail(LinkLost("the link dropped"))
    held = reading.held[wanted[0]]
    assert held.told == HOLDS["0x6041:0"]
    assert reading.problem == "the link dropped"
    assert held.is_old(held.at_ns + round((OLD_S + 0.1) * 1e9))
    reading.look(wanted)  # not at once again
    assert len(commands.named("read_objects")) == 2


def test_a_robot_that_has_started_anew_holds_nothing_of_before() -> None:
    bench = Bench(Desk())
    station = bench.add("exo-01")
    station.take([described()])
    station.objects.reading.look([(KNEE, "0x6041:0")])
    answer_reads(bench.first)
    assert station.objects.reading.held
    event = described()
    station.take([event])
    assert station.objects.reading.held
    station.take([Described(replace(event.description, boot_id="boot-2"))])
    assert not station.objects.reading.held


# --- finding, comparing, saving


def _find(objects: Objects, compared: Compared, words: str = "", kind: RowKind = RowKind.ALL) -> list[str]:
    pinned = {pin_of(KNEE, "0x6041:0")}
    found = Finder().find(objects.of(KNEE), words, compared, pinned, objects.reading.revision)
    return [info.object for info in found[kind]]


@pytest.fixture
def whole(objects: Objects, commands: FakeCommands) -> Compared:
    objects.of(KNEE)
    answer_lists(commands)
    return _read(objects, commands)


@pytest.mark.parametrize(
    ("words", "found"),
    [
        ("0x6041", ["0x6041:0"]),
        ("0x60*", ["0x6040:0", "0x6041:0", "0x6065:0", "0x6072:0"]),
        ("0x1000-0x1010", ["0x1000:0", "0x1008:0"]),
        ("STATUS", ["0x6041:0"]),
        ("tpdo1", ["0x6041:0"]),
        ("unsigned64", ["0x2001:0"]),
        ("max_torque", ["0x6072:0"]),
        ("6065", ["0x6065:0"]),
        ("nonsense", []),
    ],
)
def test_objects_are_found_by_address_range_and_all_that_is_said_of_them(
    objects: Objects, whole: Compared, words: str, found: list[str]
) -> None:
    assert _find(objects, whole, words) == found


def test_of_a_kind(objects: Objects, whole: Compared) -> None:
    assert _find(objects, whole, kind=RowKind.PARAMETERS) == ["0x6072:0"]
    assert _find(objects, whole, kind=RowKind.PINNED) == ["0x6041:0"]
    assert _find(objects, whole, kind=RowKind.DIFFERENT) == ["0x6040:0", "0x6065:0", "0x6072:0"]


def test_what_was_not_read_differs_from_nothing(objects: Objects, commands: FakeCommands) -> None:
    objects.of(KNEE)
    answer_lists(commands)
    assert _find(objects, Compared(KNEE, {}), kind=RowKind.DIFFERENT) == []


def test_two_devices_are_compared(objects: Objects, commands: FakeCommands, whole: Compared) -> None:
    other = "right_knee"
    objects.reading.look([(other, address) for address in ("0x6041:0", "0x6065:0", "0x1018:4")])
    objects.reading._next_ns = 0
    objects.reading.look([(other, address) for address in ("0x6041:0", "0x6065:0", "0x1018:4")])
    answer_reads(commands, {**HOLDS, "0x6065:0": ObjectValue(7, "7", 1)})
    beside = Compared(KNEE, whole.held, other)
    assert _find(objects, beside, kind=RowKind.DIFFERENT) == ["0x6065:0"]
    assert beside.title == "right knee"


def test_what_was_read_is_saved_with_every_digit(objects: Objects, whole: Compared) -> None:
    lines = {line[1]: line for line in cells(objects.of(KNEE).objects, whole)}
    assert lines["0x2001:0"][5] == 2**63 + 1
    assert lines["0x6065:0"][8:11] == ("EDS default", 5000, "yes")
    assert "a domain is not read" in str(lines["0x2000:1"][-1])
    assert list(cells(objects.of(KNEE).objects, Compared(KNEE, {}))) == []


# --- one object


@pytest.mark.parametrize(
    ("type_", "value", "expected"),
    [
        ("UNSIGNED16", 0x0237, {"Decimal": "567", "Hex": "0x0237", "Binary": "0000 0010 0011 0111"}),
        ("INTEGER8", -1, {"Decimal": "-1", "Hex": "0xFF", "Binary": "1111 1111"}),
        ("INTEGER64", -(2**63), {"Decimal": str(-(2**63)), "Hex": "0x8000000000000000", "Bits": "63"}),
        ("UNSIGNED64", 2**63 + 1, {"Hex": "0x8000000000000001", "Bits": "0, 63"}),
        ("UNSIGNED32", 0x65766173, {"Text": "save"}),
        ("REAL32", 1.5, {"Decimal": "1.5", "Hex": "0x3FC00000"}),
        ("VISIBLE_STRING", "abc", {"Text": "abc", "Hex": "61 62 63", "Length": "3 bytes"}),
        ("OCTET_STRING", "00ff10", {"Hex": "00 FF 10", "Length": "3 bytes"}),
        ("?", "4a6f", {"Text": "Jo", "Hex": "4A 6F"}),
        ("BOOLEAN", 1, {"Decimal": "1", "Hex": "0x01"}),
    ],
)
def test_a_value_in_every_notation(type_: str, value: int | float | str, expected: dict[str, str]) -> None:
    told = dict(forms(one("0x2000:0", "Thing", type_), ObjectValue(value, "", 1)))
    assert expected.items() <= told.items()


@pytest.mark.parametrize("address", ["0x6041:0", "0x6841:0"])
def test_bits_of_a_statusword_have_their_names(address: str) -> None:
    told = dict(forms(one(address, "Statusword"), ObjectValue(0x0018, "", 1)))
    assert told["Bits"] == "3 fault, 4 voltage enabled"


def test_what_is_locked_says_so_with_the_lines_that_release_it(whole: Compared) -> None:
    info = BY_ADDRESS["0x6065:0"]
    told = dict(facts(info, whole, None, None, info.locked or "", is_linked=True))
    assert "to release in [joint.left_knee]" in told["Not changed here"]
    assert 'release = ["following_error_window"]' in told["Released by, in robot.toml"]


def test_what_is_old_is_not_told_as_it_is_now(whole: Compared) -> None:
    info = BY_ADDRESS["0x6041:0"]
    held = ReadValue(HOLDS["0x6041:0"], time.monotonic_ns() - 60_000_000_000, 0.0)
    old = Compared(KNEE, {(KNEE, "0x6041:0"): held})
    assert "OLD: read 60 s ago" in dict(facts(info, old, None, None, "", is_linked=True))["Holds"]
    assert "OLD" in dict(facts(info, whole, None, None, "", is_linked=False))["Holds"]


def test_an_object_becomes_a_channel_by_lines_to_copy() -> None:
    info = one("0x1018:4", "Identity object.Serial number", unit="counts")
    assert channel_lines(KNEE, info) == (
        '[channel."left_knee.serial_number"]\nobject = "0x1018:4"\nunit = "counts"'
    )


# --- devices


def test_a_node_of_several_axes_is_one_device() -> None:
    node = NodeInfo(5, ["left_hip", "left_knee"], None, None, 0, 0, 0, None)
    bus = BusInfo("can0", "error active", None, None, None, 0, 0, 1, 0, [node])
    description = replace(described().description, buses=[bus])
    found = devices(description)
    assert found[0].title == "left hip + left knee · node 5"
    assert device_of(found, "left_knee") is device_of(found, "left_hip")
    assert "gait" in [one.title for one in found]  # where no bus tells of it
    assert not [one for one in found if "insole" in one.title]


def test_what_has_no_eds_is_among_them_with_why() -> None:
    broken = ComponentInfo("ankle", "device", "absent", "ankle.eds is not there")
    description = replace(described().description, components=[broken])
    assert [one.problem for one in devices(description)] == ["ankle.eds is not there"]


def test_numbers_are_read_with_the_sign_for_minus_and_texts_as_they_are() -> None:
    number, text = one("0x6065:0", "Window", "INTEGER32"), one("0x1008:0", "Name", "VISIBLE_STRING")
    assert for_reading(number, "-6700") == "−6700"
    assert for_reading(text, "-A -6700") == "-A -6700"
    assert limits(replace(number, min=-6700, max=6700)) == "−6700 … 6700"
    held = {("left_knee", number.object): ReadValue(ObjectValue(-6700, "-6700", 1), time.monotonic_ns(), 0.0)}
    said = dict(facts(number, Compared("left_knee", held), None, None, "", is_linked=True))
    assert said["Holds"] == "−6700"
    assert said["Decimal, Hex, Binary"].startswith("−6700 · 0xFFFFE5D4")
