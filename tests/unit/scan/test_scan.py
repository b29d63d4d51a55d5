"""An unknown bus tells who lives on it; who is asked says what it is; nothing is ever written."""

import json
import threading
import tomllib
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from drivers.bus.settings import CanSettings
from drivers.cli.scan import main
from drivers.errors import Unavailable
from drivers.scan.identification import NodeAnswers
from drivers.scan.products import Library, files
from drivers.scan.report import as_text
from drivers.scan.scan import ScanResult, scan
from drivers.scan.traffic import Traffic
from eds.shipped import SHIPPED
from tests.unit.bus.fake_node import FakeNode

MS = 1_000_000


def u32(number: int) -> bytes:
    return number.to_bytes(4, "little")


DRIVE = {
    (0x1000, 0): u32(0x00020192),
    (0x1001, 0): b"\x09",
    (0x1008, 0): b"Joint drive of some length\0",
    (0x1017, 0): b"\0\0",
    (0x1018, 1): u32(0x0000008A),
    (0x1018, 2): u32(0x21),
    (0x1018, 4): u32(4711),
    (0x6041, 0): b"\x50\x02",
    (0x6502, 0): u32(0b1010_0000),
    (0x1800, 1): u32(0x185),
    (0x1800, 2): b"\x01",
    (0x1A00, 0): b"\x01",
    (0x1A00, 1): u32(0x60410010),
}


@pytest.fixture
def channel(request: pytest.FixtureRequest) -> str:
    return str(request.node.nodeid)


@pytest.fixture
def found(channel: str) -> Iterator[Callable[..., ScanResult]]:
    """Scan while these nodes live, each told what to send as soon as the scan listens."""
    with ExitStack() as stack:

        def run(*nodes: FakeNode, send: Callable[[], None] = lambda: None, active: bool = True) -> ScanResult:
            for node in nodes:
                stack.enter_context(node)
            waited = threading.Event()

            def wait(seconds: float) -> None:
                if seconds == LISTEN_S:
                    send()
                waited.wait(min(seconds, 0.2))

            settings = CanSettings(interface="virtual", channel=channel)
            return scan(settings, LISTEN_S, wait, active=active)

        yield run


LISTEN_S = 0.4


def test_nothing_is_sent_by_who_only_listens(channel: str, found: Callable[..., ScanResult]) -> None:
    node = FakeNode(channel, 5, DRIVE)
    seen = found(node, send=node.heartbeat, active=False)
    assert seen.nodes == (5,)
    assert node.seen == []


def test_who_is_asked_says_what_it_is_and_nothing_is_written(
    channel: str, found: Callable[..., ScanResult]
) -> None:
    node = FakeNode(channel, 5, DRIVE)
    told = found(node).told[5]
    assert isinstance(told, NodeAnswers)
    assert (told.device_type, told.name, told.serial_number) == (0x20192, "Joint drive of some length", 4711)
    assert [(axis.number, axis.modes) for axis in told.axes] == [(0, 0b1010_0000)]
    assert [(tpdo.cob_id, [o.index for o in tpdo.objects]) for tpdo in told.tpdos] == [(0x185, [0x6041])]
    assert node.writes == []
    assert {can_id for can_id, _ in node.seen} == {0x600 + id_ for id_ in range(1, 128)}


def test_a_node_that_somebody_else_asks_is_left_alone(channel: str, found: Callable[..., ScanResult]) -> None:
    node, other = FakeNode(channel, 5, DRIVE), FakeNode(channel, 9, DRIVE)
    seen = found(node, other, send=lambda: other.send(0x605, bytes.fromhex("40 00 10 00 00 00 00 00")))
    assert list(seen.told) == [9]
    assert seen.not_asked == {5}
    assert [data for can_id, data in other.seen if can_id == 0x605] == []


def test_a_node_that_somebody_begins_to_ask_meanwhile_is_left_alone_too(
    channel: str, found: Callable[..., ScanResult]
) -> None:
    other = FakeNode(channel, 9, DRIVE)
    begin = bytes.fromhex("40 41 60 00 00 00 00 00")

    def also_ask(request: bytes) -> None:
        if request != begin:
            other.send(0x605, begin)

    node = FakeNode(channel, 5, DRIVE, on_request=also_ask)
    seen = found(node, other)
    assert list(seen.told) == [9]
    assert seen.not_asked == {5}
    assert len(node.requests) <= 2, "of us it has heard the first question alone"


def test_a_node_that_falls_silent_is_told_as_far_as_it_answered(
    channel: str, found: Callable[..., ScanResult]
) -> None:
    node = FakeNode(channel, 5, DRIVE, deaf_to={(0x1018, 2)})
    told = found(node).told[5]
    assert isinstance(told, NodeAnswers)
    assert (told.vendor_id, told.product_code, told.tpdos) == (0x8A, None, ())
    assert told.problem is not None
    assert "1018" in told.problem


def test_an_interface_that_cannot_be_opened_is_told_with_what_to_do() -> None:
    with pytest.raises(Unavailable, match="there is no interface nocan0"):
        scan(CanSettings(interface="socketcan", channel="nocan0"), 0.1, lambda s: None, active=True)


def test_traffic_tells_master_states_and_periods() -> None:
    traffic = Traffic()
    for number in range(5):
        traffic.take(number * 10 * MS, 0x080, b"")
        traffic.take(number * 100 * MS, 0x705, b"\x05")
        traffic.take(number * 10 * MS, 0x185, bytes(8))
    traffic.take(0, 0x000, b"\x01\x05")
    traffic.take(0, 0x205, bytes(2))
    traffic.take(0, 0x706, b"\x00")
    traffic.take(0, 0x7F0, b"\x00")
    assert list(traffic.master()) == ["NMT commands (1)", "SYNC every 10 ms", "RPDOs to 5"]
    assert traffic.nodes() == {5, 6}
    assert traffic.boots == {6: 1}
    assert traffic.seen[0x705].period_s == pytest.approx(0.1)
    assert traffic.others() == (0x7F0,)


def test_a_silent_bus_is_never_called_well(found: Callable[..., ScanResult]) -> None:
    lines = list(as_text(CanSettings(interface="virtual", channel="x"), found(), {}, active=True))
    assert "  silent      nothing was sent, by anybody: check bit rate, wiring and power" in lines


# Files


def made(folder: Path, name: str, revision: int = 3) -> None:
    text = (
        f"[DeviceInfo]\nVendorNumber=0x8A\nProductNumber=0x21\n[1000]\nParameterName=Type\nDataType=7\n"
        f"AccessType=ro\nDefaultValue=0x20192\n[1018]\nParameterName=Identity\nObjectType=9\n[1018sub3]\n"
        f"ParameterName=Revision\nDataType=7\nAccessType=ro\nDefaultValue={revision}\n"
    )
    (folder / name).write_text(text)


def told(**changes: object) -> NodeAnswers:
    values = {
        "device_type": 0x20192, "error_register": 0, "name": None, "hardware": None, "software": None,
        "vendor_id": 0x8A, "product_code": 0x21, "revision": 3, "serial_number": None, "heartbeat_ms": 100,
        "axes": (), "tpdos": (),
    }  # fmt: skip
    return NodeAnswers(**(values | changes))  # type: ignore[arg-type]


def test_the_file_of_vendor_and_product_is_proposed_the_best_first(tmp_path: Path) -> None:
    (tmp_path / "deep").mkdir()
    made(tmp_path, "older.eds", revision=2)
    made(tmp_path / "deep", "right.eds")
    (tmp_path / "broken.eds").write_text("nothing")
    library = Library(files([tmp_path]))
    first, second = library.proposals(5, told())
    assert (first.description.path.name, first.differs) == ("right.eds", ())
    assert second.differs == ("1018h revision is 0x3, the file says 0x2",)
    assert [path.name for path in library.unreadable] == ["broken.eds"]
    assert library.proposals(5, told(product_code=0x22)) == ()
    assert library.proposals(5, told(vendor_id=None)) == ()


def test_the_shipped_files_are_known() -> None:
    assert SHIPPED / "joint_drive.eds" in files([])
    assert files([SHIPPED]) == files([SHIPPED, SHIPPED]) == files([])


# The command


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([], "name a bus"),
        (["can0", "--seconds", "0"], "--seconds 0 is outside"),
        (["can0", "--eds", "/nowhere"], "there is no such folder"),
    ],
)
def test_wrong_usage_is_named(arguments: list[str], words: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as caught:
        main(arguments)
    assert caught.value.code == 2
    assert words in capsys.readouterr().err


def test_the_buses_of_a_file_are_scanned_though_the_rest_is_wrong(
    tmp_path: Path, channel: str, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "robot.toml"
    path.write_text(
        f'[joint.x]\nwrong = 1\n[can.main]\ninterface = "virtual"\nchannel = {json.dumps(channel)}\n'
    )
    with FakeNode(channel, 7, DRIVE):
        assert main([str(path), "--active", "--seconds", "0.1", "--json"]) == 0
    (node,) = json.loads(capsys.readouterr().out)["nodes"]
    assert (node["node_id"], node["answer"]["serial_number"]) == (7, 4711)


def test_a_node_is_told_in_words(channel: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    made(tmp_path, "drive.eds")
    with FakeNode(channel, 7, DRIVE):
        assert main([f"virtual:{channel}", "--active", "--seconds", "0.1", "--eds", str(tmp_path)]) == 0
    text = capsys.readouterr().out
    assert "node 7: state unknown, no heartbeat" in text
    assert "device      servo drive (CiA 402): Joint drive of some length" in text
    assert "error       generic, temperature (1001h = 0x09)" in text
    assert "heartbeat   off (1017h = 0)" in text
    assert "axis 0      homing, cyclic synchronous position" in text
    assert f"EDS         {tmp_path / 'drive.eds'}" in text
    assert "has a TPDO1, which the file lacks" in text


SHIPPED_DRIVE = DRIVE | {
    (0x1018, 1): u32(0),
    (0x1018, 2): u32(0x4A440001),
    (0x608F, 1): u32(16_384),
    (0x608F, 2): u32(1),
    (0x6091, 1): u32(1),
    (0x6091, 2): u32(1),
}


def test_a_known_device_has_its_profile_and_a_table_to_paste_with_what_it_says_itself(
    channel: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with FakeNode(channel, 7, SHIPPED_DRIVE):
        assert main([f"virtual:{channel}", "--active", "--seconds", "0.1"]) == 0
    text = capsys.readouterr().out
    assert "  profile     GWRMS joint drive" in text
    table = text.partition("for robot.toml")[2]
    found = tomllib.loads(table)["joint"]["node_7"]
    assert found == {
        "bus": "main",
        "node_id": 7,
        "eds": "joint_drive.eds",
        "counts_per_revolution": 16_384,
    }
    assert "# gear_ratio" in table, "1:1 is what drives hold that were never told"


def test_a_table_of_a_files_bus_is_on_that_bus(
    tmp_path: Path, channel: str, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "robot.toml"
    path.write_text(f'[can.legs]\ninterface = "virtual"\nchannel = {json.dumps(channel)}\n')
    with FakeNode(channel, 7, SHIPPED_DRIVE):
        assert main([str(path), "--active", "--seconds", "0.1", "--json"]) == 0
    (node,) = json.loads(capsys.readouterr().out)["nodes"]
    assert node["profile"] == "GWRMS joint drive"
    assert tomllib.loads(node["table"])["joint"]["node_7"]["bus"] == "legs"


def test_an_interface_that_is_not_there_hides_no_other(
    channel: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["nocan0", f"virtual:{channel}", "--seconds", "0.1"]) == 1
    told = capsys.readouterr()
    assert "nocan0: there is no interface nocan0" in told.err
    assert "silent" in told.out
