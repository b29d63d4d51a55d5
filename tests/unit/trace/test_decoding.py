"""Every service of CiA 301 and CiA 305 in words; PDOs by the mapping that counts now; filters; load."""

import pytest

import eds
from drivers.bus.frames import ERROR, EXTENDED, REMOTE
from drivers.errors import SettingsError
from drivers.trace.decoding import DecodedFrame, Decoder, FrameKind
from drivers.trace.devices import Device, Devices
from drivers.trace.files import Captured
from drivers.trace.filters import by_kind, by_node, by_object
from drivers.trace.load import Meter
from tests.unit.trace.test_sdo import SEGMENTED

KNEE = Device(2, "left_knee", eds.load(eds.locate("joint_drive.eds", None), 2))


def decoder() -> Decoder:
    description = KNEE.description
    return Decoder(Devices([Device(2, "left_knee", description)]))


def line(can_id: int, data: str = "", by: Decoder | None = None) -> DecodedFrame:
    return (by or decoder()).take(Captured(0, can_id, bytes.fromhex(data)))


@pytest.mark.parametrize(
    ("can_id", "data", "kind", "node_id", "words"),
    [
        (0x000, "01 02", FrameKind.NMT, None, "start: left_knee"),
        (0x000, "82 00", FrameKind.NMT, None, "reset communication: all nodes"),
        (0x000, "07 05", FrameKind.NMT, None, "service 0x07, which CiA 301 does not know: node 5"),
        (0x000, "01", FrameKind.NMT, None, "no NMT command: 1 bytes"),
        (0x080, "", FrameKind.SYNC, None, ""),
        (0x080, "05", FrameKind.SYNC, None, "counter 5"),
        (0x100, "88 13 00 00 01 00", FrameKind.TIME, None, "1984-01-02 00:00:05.000"),
        (0x100, "00", FrameKind.TIME, None, "no TIME: 1 bytes"),
        (0x082, "11 86 21 00 00 00 00 00", FrameKind.EMCY, 2, "0x8611"),
        (0x085, "00 00 00 00 00 00 00 00", FrameKind.EMCY, 5, "no error any more"),
        (0x085, "01", FrameKind.EMCY, 5, "no EMCY: 1 bytes"),
        (0x702, "00", FrameKind.HEARTBEAT, 2, "boot-up"),
        (0x702, "85", FrameKind.HEARTBEAT, 2, "operational"),
        (0x702, "33", FrameKind.HEARTBEAT, 2, "no heartbeat: 33"),
        (0x702 | REMOTE, "", FrameKind.HEARTBEAT, 2, "is asked for its state (node guarding)"),
        (0x602, "40 41 60 00 00 00 00 00", FrameKind.SDO, 2, "read 6041h:00 Statusword"),
        (0x605, "40 41 60 00 00 00 00 00", FrameKind.SDO, 5, "read 6041h:00"),
        (
            0x582,
            "4B 41 60 00 37 02 00 00",
            FrameKind.SDO,
            2,
            "is 6041h:00 Statusword: 0x0237 (operation enabled)",
        ),
        (0x585, "4B 41 60 00 37 02 00 00", FrameKind.SDO, 5, "is 6041h:00: 37 02"),
        (0x585, "80 41 60 00 00 00 02 06", FrameKind.SDO, 5, "abort 6041h:00: the device has no such object"),
        (0x602, "00 01", FrameKind.SDO, 2, "no SDO: 2 bytes"),
        (0x582, "4B 17 10 00 64 00 00 00", FrameKind.SDO, 2, "1017h:00 Producer heartbeat time: 100"),
        (0x582, "43 00 18 01 82 01 00 40", FrameKind.SDO, 2, ": 0x40000182"),
        (0x285, "01 02", FrameKind.PDO, 5, "01 02"),
        (0x182 | REMOTE, "", FrameKind.PDO, 2, "is asked for"),
        (0x7E5, "04 01 00 00 00 00 00 00", FrameKind.LSS, None, "all: configuration"),
        (0x7E5, "43 07 00 00 00 00 00 00", FrameKind.LSS, None, "select by serial number 0x7"),
        (
            0x7E5,
            "51 00 00 00 80 1F 03 03",
            FrameKind.LSS,
            None,
            "fastscan: serial number 0x80000000 from bit 31",
        ),
        (
            0x7E5,
            "51 00 00 00 00 80 00 00",
            FrameKind.LSS,
            None,
            "fastscan: is there anybody without a node id?",
        ),
        (0x7E5, "13 00 02 00 00 00 00 00", FrameKind.LSS, None, "bit rate 500000 bit/s"),
        (0x7E4, "11 01 00 00 00 00 00 00", FrameKind.LSS, None, "node id: refused, error 1"),
        (0x7E4, "5E FF 00 00 00 00 00 00", FrameKind.LSS, None, "node id none (255)"),
        (0x7E4, "4F", FrameKind.LSS, None, "no LSS that is known: 4F"),
        (0x7F0, "AB", FrameKind.OTHER, None, "AB"),
        (0x12345678 | EXTENDED, "", FrameKind.OTHER, None, "empty"),
        (0x185 | EXTENDED, "01", FrameKind.OTHER, None, "01"),
        (0x004 | ERROR, "00 20 00 00 00 00 00 00", FrameKind.ERROR, None, "error passive"),
        (0x008 | ERROR, "00 00 00 00 00 00 00 00", FrameKind.ERROR, None, "error on the wire"),
    ],
)
def test_each_service_is_told_in_words(
    can_id: int, data: str, kind: FrameKind, node_id: int | None, words: str
) -> None:
    found = line(can_id, data)
    assert (found.kind, found.node_id) == (kind, node_id)
    assert words in found.words
    assert words or not found.words


def test_a_pdo_is_told_by_the_mapping_of_its_eds() -> None:
    found = line(0x182, "37 12 F0 D8 FF FF")
    assert found.title == "TPDO1"
    assert [(value.index, value.value) for value in found.values] == [(0x6041, 0x1237), (0x6064, -10000)]
    assert "Statusword = 0x1237 (operation enabled)" in found.words
    assert "2 bytes, shorter than its mapping" in line(0x182, "37 12").words


MAPPED = (  # by SDO, as a master does it: off, other objects, on
    (0x602, "23 00 18 01 82 01 00 80"),
    (0x602, "2F 00 1A 00 00 00 00 00"),
    (0x602, "23 00 1A 01 10 00 77 60"),
    (0x602, "2F 00 1A 00 01 00 00 00"),
    (0x602, "23 00 18 01 82 01 00 00"),
)


def test_a_mapping_that_is_written_meanwhile_counts_once_the_device_has_taken_it() -> None:
    by = decoder()
    line(*MAPPED[0], by)
    assert "6064h" in line(0x182, "37 12 F0 D8 FF FF", by).words, "it has not answered"
    for can_id, data in MAPPED:
        line(can_id, data, by)
        line(0x582, f"60 {data[3:11]} 00 00 00 00", by)
    found = line(0x182, "FE FF", by)
    assert [(value.index, value.value) for value in found.values] == [(0x6077, -2)]


def test_a_mapping_that_is_refused_changes_nothing() -> None:
    by = decoder()
    line(0x602, MAPPED[1][1], by)
    line(0x582, "80 00 1A 00 22 00 00 08", by)
    assert len(line(0x182, "37 12 F0 D8 FF FF", by).values) == 2


def test_a_mapping_that_is_only_read_is_learned_without_an_eds() -> None:
    by = Decoder()
    for index, subindex, size, value in (
        (0x1800, 1, 4, 0x185),
        (0x1A00, 0, 1, 1),
        (0x1A00, 1, 4, 0x60410010),
    ):
        head = bytes([0x43 | (4 - size) << 2]) + index.to_bytes(2, "little") + bytes([subindex])
        line(0x585, (head + value.to_bytes(4, "little")).hex(), by)
    assert line(0x185, "37 02", by).words == "6041h:00 = 37 02"


def test_a_frame_that_commands_is_told_by_who_takes_it() -> None:
    sender = Device(16, "gait", eds.load(eds.locate("gait_controller.eds", None), 16))
    by = Decoder(Devices([KNEE, sender]))
    found = line(0x202, "0F 00 08 10 27 00 00", by)
    assert (found.name, found.title) == ("left_knee", "RPDO1")
    assert "Target position (counts) = 10000" in found.words
    assert line(0x182, "37 12 F0 D8 FF FF", by).words.endswith("   to gait")


def test_a_text_is_told_when_its_last_segment_has_come() -> None:
    by = decoder()
    lines = [line(0x602 if frame[0] == ">" else 0x582, frame[1:], by) for frame in SEGMENTED]
    assert lines[-1].words.endswith(': "ABCDEFGHIJ"')
    assert [value.value for value in lines[-1].values] == ["ABCDEFGHIJ"]


# What is wanted


WALK = [
    line(0x000, "01 00"),
    line(0x000, "01 05"),
    line(0x182, "37 12 F0 D8 FF FF"),
    line(0x702, "05"),
    line(0x705, "05"),
    line(0x602, "40 64 60 00 00 00 00 00"),
]


@pytest.mark.parametrize(
    ("wanted", "found"),
    [
        (by_node(["left_knee"], [KNEE], lambda _interface: [KNEE]), [0, 2, 3, 5]),
        (by_node(["5"], [], lambda _interface: []), [0, 1, 4]),
        (by_kind(["nmt,sdo"]), [0, 1, 5]),
        (by_kind(["pdo", "heartbeat"]), [2, 3, 4]),
        (by_object(["0x6064"]), [2, 5]),
        (by_object(["6064h:00"]), [2, 5]),
        (by_object(["0x6064:1"]), []),
        (by_object(["*position*"]), [2]),
        (by_object(["0x6072", "0x6041"]), [2]),
    ],
)
def test_only_what_is_wanted_is_shown(wanted: object, found: list[int]) -> None:
    assert callable(wanted)
    assert [number for number, one in enumerate(WALK) if wanted(one)] == found


def test_what_nobody_has_is_refused() -> None:
    with pytest.raises(SettingsError, match="known are left_knee"):
        by_node(["left_kne"], [KNEE], lambda _interface: [KNEE])
    with pytest.raises(SettingsError, match="from 1 to 127"):
        by_node(["200"], [KNEE], lambda _interface: [KNEE])
    with pytest.raises(SettingsError, match="there are nmt, sync"):
        by_kind(["pdos"])


# Load


def test_the_load_is_told_by_node_and_kind_as_for_the_whole_bus() -> None:
    meter = Meter(1_000_000)
    for _ in range(100):
        meter.take(Captured(0, 0x182, bytes(8)))
        meter.take(Captured(0, 0x282, bytes(8)))
    for _ in range(10):
        meter.take(Captured(0, 0x705, bytes(1)))
    meter.take(Captured(0, 0x705 | REMOTE, b""))
    meter.take(Captured(0, 0x008 | ERROR, bytes(8)))
    load = meter.told(2.0)
    rows = [(share.kind, share.node_id, share.frames_per_s, round(share.bits_per_s)) for share in load.shares]
    assert rows == [("TPDO", 2, 100.0, 11830), ("heartbeat", 5, 5.5, 315)]
    assert load.percent == pytest.approx(1.2145, rel=1e-3)
    assert load.error_frames == 1
    assert meter.told(1.0).shares == ()


def test_without_a_bit_rate_no_share_is_made_up() -> None:
    meter = Meter(None)
    meter.take(Captured(0, 0x182, bytes(8)))
    load = meter.told(1.0)
    assert (load.percent, load.shares[0].percent) == (None, None)
