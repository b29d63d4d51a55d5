"""Devices without a node id are found, all of them; what a device is given it has, or has what it had."""

import itertools
from pathlib import Path
from types import SimpleNamespace

import pytest

from drivers.errors import DeviceTimeout, LssRefusal, Mismatch, NotPermitted, SettingsError
from drivers.lss import change
from drivers.lss import master as lss
from drivers.lss.change import Device, give_bitrate, give_node_id, inquire
from drivers.lss.fastscan import unconfigured
from drivers.lss.master import UNCONFIGURED, Identity, LssMaster
from drivers.lss.preconditions import BusSurvey
from drivers.scan.traffic import Traffic
from hil_sim.bus.can_bus import Frame
from hil_sim.node.lss import LssState
from tests.unit.lss.lines import PRODUCT, REVISION, VENDOR, Line

ANSWER = 0x7E4
QUICK_S = 0.001  # whoever answers has done so before the master looks


@pytest.fixture(autouse=True)
def nobody_answers_twice(monkeypatch: pytest.MonkeyPatch) -> None:
    """What comes has come when the master looks: it need not wait for more."""
    for name in ("SETTLE_S", "GAP_S"):
        monkeypatch.setattr(lss, name, QUICK_S / 10)


def identity(serial: int) -> Identity:
    return Identity(VENDOR, PRODUCT, REVISION, serial)


def master_of(line: Line) -> LssMaster:
    return LssMaster(line, QUICK_S, QUICK_S)


def nobody_is_left_selected(line: Line) -> bool:
    return all(node.lss.state is LssState.WAITING for node in line.nodes.values())


# Finding


@pytest.mark.parametrize(
    "serials",
    [
        (),
        (7,),
        (0,),
        (0xFFFFFFFF,),
        (6, 7),
        (0, 0x80000000, 0xFFFFFFFF),
        (0xA5A5A5A5, 0x5A5A5A5A, 0xA5A5A5A4),
    ],
)
def test_every_device_without_a_node_id_is_found_and_none_is_touched(
    tmp_path: Path, serials: tuple[int, ...]
) -> None:
    line = Line(tmp_path, {**dict.fromkeys(serials, UNCONFIGURED), 99: 9})
    with master_of(line) as master:
        assert unconfigured(master) == [identity(serial) for serial in sorted(serials)]
    assert nobody_is_left_selected(line)
    assert {serial for serial, node in line.nodes.items() if node.lss.configured} == {99}
    assert {can_id for can_id, _ in line.sent} == {0x7E5}


def test_devices_of_several_makers_are_found(tmp_path: Path) -> None:
    line = Line(tmp_path, dict.fromkeys((1, 2, 3), UNCONFIGURED))
    line.nodes[2].dictionary[0x1018, 1].value = 0xFFFFFFFF
    line.nodes[3].dictionary[0x1018, 2].value = PRODUCT + 1
    with master_of(line) as master:
        found = unconfigured(master)
    assert found == [
        identity(1),
        Identity(VENDOR, PRODUCT + 1, REVISION, 3),
        Identity(0xFFFFFFFF, PRODUCT, REVISION, 2),
    ]


def test_an_answer_that_is_lost_is_never_an_identity_that_nobody_has(tmp_path: Path) -> None:
    line = Line(tmp_path, {7: UNCONFIGURED})
    heard: list[Frame] = []

    def loses(frame: Frame) -> bool:
        if frame.cob_id == ANSWER:
            heard.append(frame)
        return frame.cob_id == ANSWER and len(heard) in lost

    line.loses = loses
    lost = {5}
    with master_of(line) as master:
        assert unconfigured(master) == [identity(7)], "the second search has more patience"
    heard.clear()
    lost = set(range(5, 100_000, 40))
    with master_of(line) as master, pytest.raises(Mismatch, match="search again, with a longer --timeout"):
        unconfigured(master)


def test_a_device_that_knows_no_fastscan_is_not_overlooked(tmp_path: Path) -> None:
    line = Line(tmp_path, {7: UNCONFIGURED})
    line.nodes[7].lss.scans = False
    with master_of(line) as master:
        with pytest.raises(Mismatch, match="knows no fastscan"):
            unconfigured(master)
        assert give_node_id(line, master, inquire(master, None), 6, store=True) == Device(identity(7), 6)


# Asking


def test_an_answer_that_has_come_counts_though_this_computer_stood_still(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    late = SimpleNamespace(monotonic=itertools.count(0.0, 10.0).__next__)  # at every look
    monkeypatch.setattr(lss, "time", late)
    with master_of(Line(tmp_path, {7: 5})) as master:
        assert inquire(master, identity(7)) == Device(identity(7), 5)


def test_a_device_says_who_it_is(tmp_path: Path) -> None:
    line = Line(tmp_path, {7: 5, 8: UNCONFIGURED})
    with master_of(line) as master:
        assert inquire(master, identity(7)) == Device(identity(7), 5)
        assert inquire(master, identity(8)) == Device(identity(8), UNCONFIGURED)
    assert nobody_is_left_selected(line)


def test_the_only_device_needs_no_identity_and_two_are_not_one(tmp_path: Path) -> None:
    with master_of(Line(tmp_path, {7: 5})) as master:
        assert inquire(master, None) == Device(identity(7), 5)
    line = Line(tmp_path, {7: 5, 8: 6})
    with master_of(line) as master, pytest.raises(Mismatch, match="2 devices answer"):
        inquire(master, None)
    assert nobody_is_left_selected(line)


@pytest.mark.parametrize("frame", ["01 05", None])
def test_who_does_not_answer_is_told_with_what_may_be_why(tmp_path: Path, frame: str | None) -> None:
    line = Line(tmp_path, {7: 5})
    if frame:
        line.send(0x000, bytes.fromhex(frame))  # an operational device does not
    with master_of(line) as master, pytest.raises(DeviceTimeout, match="is it not operational"):
        inquire(master, identity(7 if frame else 8))


def test_frames_that_are_no_answer_are_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    line = Line(tmp_path, {7: 5})
    line.bus.attach("chatter", lambda _frame, _sender: None)
    send = line.send

    def disturbed(can_id: int, data: bytes) -> None:
        line.bus.send(Frame(ANSWER, bytes.fromhex("4F 00 00 00 00 00 00 00")), "chatter")
        line.bus.send(Frame(ANSWER, b"\x5e"), "chatter")
        send(can_id, data)

    monkeypatch.setattr(line, "send", disturbed)
    with master_of(line) as master:
        assert inquire(master, identity(7)).node_id == 5


# Giving


@pytest.mark.parametrize("before", [UNCONFIGURED, 5, 42])
def test_a_node_id_is_stored_booted_with_and_asked_for_again(tmp_path: Path, before: int) -> None:
    line = Line(tmp_path, {7: before, 8: 6})
    with master_of(line) as master:
        device = inquire(master, identity(7))
        assert give_node_id(line, master, device, 42, store=True) == Device(identity(7), 42)
    node = line.nodes[7]
    node.power_off()
    node.power_on()
    assert (node.lss.node_id, line.nodes[8].lss.node_id) == (42, 6)
    resets = [data for can_id, data in line.sent if can_id == 0x000]
    assert resets == ([b"\x82\x05"] if before == 5 else []), "that node alone, and nobody without need"


def test_without_store_it_lasts_until_the_power_goes(tmp_path: Path) -> None:
    line = Line(tmp_path, {7: 5})
    with master_of(line) as master:
        assert give_node_id(line, master, Device(identity(7), 5), 6, store=False).node_id == 6
    line.nodes[7].power_off()
    line.nodes[7].power_on()
    assert line.nodes[7].lss.node_id == 5


@pytest.mark.parametrize("before", [UNCONFIGURED, 5])
def test_a_device_that_cannot_store_keeps_what_it_had(tmp_path: Path, before: int) -> None:
    line = Line(tmp_path, {7: before})
    line.nodes[7].lss.stores = False
    with master_of(line) as master:
        with pytest.raises(LssRefusal, match=r"cannot store .*\(error 1\); it was put back") as refused:
            give_node_id(line, master, Device(identity(7), before), 6, store=True)
        assert refused.value.error_code == 1
        assert inquire(master, identity(7)).node_id == before
    assert line.nodes[7].lss.pending_node_id == before
    assert nobody_is_left_selected(line)


def test_a_device_that_does_not_boot_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(change, "BOOT_S", 0.01)
    line = Line(tmp_path, {7: 5})
    line.loses = lambda frame: frame.cob_id == 0x706
    with master_of(line) as master, pytest.raises(DeviceTimeout, match="stored it and did not boot with it"):
        give_node_id(line, master, Device(identity(7), 5), 6, store=True)


def test_who_only_says_yes_is_found_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    line = Line(tmp_path, {7: 5})
    monkeypatch.setattr(line.nodes[7].lss, "_take_node_id", lambda _node_id: 0)
    send = line.send

    def with_a_boot_up_of_somebody_else(can_id: int, data: bytes) -> None:
        if can_id == 0x000:
            line.bus.send(Frame(0x706, b"\0"), "somebody else")
        send(can_id, data)

    monkeypatch.setattr(line, "send", with_a_boot_up_of_somebody_else)
    with master_of(line) as master, pytest.raises(Mismatch, match="was given node id 6 and says 5"):
        give_node_id(line, master, Device(identity(7), 5), 6, store=True)


@pytest.mark.parametrize(
    ("bitrate", "offered", "words"), [(500_000, True, ""), (20_000, False, "no bit rate")]
)
def test_a_bit_rate_counts_from_the_next_power_on(
    tmp_path: Path, bitrate: int, offered: bool, words: str
) -> None:
    line = Line(tmp_path, {7: 5})
    node = line.nodes[7]
    if not offered:
        node.lss.bitrates -= {bitrate}
    with master_of(line) as master:
        if words:
            with pytest.raises(LssRefusal, match=words):
                give_bitrate(master, Device(identity(7), 5), bitrate, 1_000_000)
            return
        give_bitrate(master, Device(identity(7), 5), bitrate, 1_000_000)
        assert inquire(master, identity(7)).node_id == 5, "it is still heard"
        node.power_off()
        node.power_on()
        with pytest.raises(DeviceTimeout):
            inquire(master, identity(7))
        line.bus.bitrate = bitrate
        assert inquire(master, identity(7)).node_id == 5


def test_a_bit_rate_that_cannot_be_stored_is_put_back(tmp_path: Path) -> None:
    line = Line(tmp_path, {7: 5})
    line.nodes[7].lss.stores = False
    with master_of(line) as master:
        with pytest.raises(LssRefusal, match="it was put back"):
            give_bitrate(master, Device(identity(7), 5), 500_000, 1_000_000)
        assert line.nodes[7].lss.pending_bitrate == 1_000_000
        with pytest.raises(LssRefusal, match="Putting back what it had failed too"):
            give_bitrate(master, Device(identity(7), 5), 500_000, None)


# Whether at all


def heard(*frames: tuple[int, str]) -> BusSurvey:
    traffic = Traffic()
    for stamp, (can_id, data) in enumerate(frames):
        traffic.take(stamp, can_id, bytes.fromhex(data))
    return BusSurvey("can0", 3.0, traffic)


@pytest.mark.parametrize(
    ("frame", "words"),
    [
        ((0x705, "05"), "operational: node 5"),
        ((0x183, "00"), "operational: node 3"),
        ((0x080, ""), "somebody leads this bus: SYNC"),
        ((0x000, "01 00"), "NMT commands"),
        ((0x605, "40 00 10 00 00 00 00 00"), "SDO requests to 5"),
        ((0x202, "0F 00"), "RPDOs to 2"),
        ((0x7E5, "04 01 00 00 00 00 00 00"), "LSS requests"),
        ((0x100, "00 00 00 00 00 00"), "TIME"),
    ],
)
def test_where_somebody_is_at_work_nothing_is_configured(frame: tuple[int, str], words: str) -> None:
    with pytest.raises(NotPermitted, match=words):
        heard(frame).refuse()


def test_devices_that_only_wait_are_no_objection() -> None:
    heard((0x705, "7F"), (0x706, "00"), (0x707, "04"), (0x085, "00 00 00 00 00 00 00 00")).refuse()


@pytest.mark.parametrize("text", ["", "1:2:3", "1:2:3:x", "1:2:3:4:5", "1:2:3:-4", "1:2:3:4294967296"])
def test_an_identity_is_four_numbers(text: str) -> None:
    with pytest.raises(SettingsError, match="no identity"):
        Identity.parse(text)
    assert Identity.parse(str(identity(7))) == identity(7)
