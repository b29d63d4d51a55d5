"""What a joint's channels need is mapped into the drive and stored there on word; else it is as it was."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from drivers.bus.settings import CanSettings
from drivers.scan.identification import Axis as ToldAxis
from drivers.scan.identification import NodeAnswers
from gateway.commission import nodes
from gateway.commission.axes import Axis
from gateway.commission.bench import CanBench
from gateway.commission.dialogue import run
from gateway.commission.draft import Draft
from tests.unit.commission.fake_bench import Hands
from tests.unit.commission.homing_drive import HomingDrive

NODE = 5
TOLD = NodeAnswers(
    0x20192, 0, "drive", None, None, 0, 0x4A44_0001, None, 1, 100, (ToldAxis(0, None, None),), ()
)
JOINT = "joint.left_knee"


def tpdos() -> dict[tuple[int, int], bytes]:
    """Four, all disabled, with room for four objects each."""
    found: dict[tuple[int, int], bytes] = {}
    for number in range(4):
        found |= {
            (0x1800 + number, 1): (0x8000_0185 + (number << 8)).to_bytes(4, "little"),
            (0x1800 + number, 2): b"\x01",
            (0x1800 + number, 5): bytes(2),
            (0x1A00 + number, 0): b"\x00",
            **{(0x1A00 + number, entry): bytes(4) for entry in range(1, 5)},
        }
    return found


@pytest.fixture
def draft(tmp_path: Path) -> Draft:
    made = Draft(tmp_path / "exo-01.toml")
    made.put(f"node.{NODE}", "eds", "joint_drive.eds")
    return made


@pytest.fixture
def channel(request: pytest.FixtureRequest) -> str:
    return str(request.node.nodeid)


@pytest.fixture
def bench(channel: str) -> Iterator[CanBench]:
    made = CanBench("main", CanSettings(interface="virtual", channel=channel))
    yield made
    made.close()


def mapped(drive: HomingDrive, number: int) -> list[int]:
    entries = range(1, drive.objects[0x1A00 + number, 0][0] + 1)
    return [int.from_bytes(drive.objects[0x1A00 + number, entry][2:], "little") for entry in entries]


def answering(store: str) -> Hands:
    return Hands(("May the", lambda: "y"), ("store it there", lambda: store))


def test_what_is_mapped_is_stored_and_the_gateway_has_nothing_to_do(
    draft: Draft, bench: CanBench, channel: str
) -> None:
    with HomingDrive(channel, NODE, objects={**tpdos(), (0x1010, 1): bytes(4)}) as drive:
        run(nodes.mapping(draft, bench, Axis(NODE), TOLD, "left_knee"), hands := answering("y"))
        assert drive.objects[0x1010, 1] == b"save"
        assert mapped(drive, 0)[:2] == [0x6041, 0x6064]
        assert 0x606C in mapped(drive, 1)
        assert drive.words == []
    assert hands.heard("TPDO1 (0x185) was given statusword, position and")
    assert draft.value(JOINT, "configure_pdos") is False
    assert "stored in the drive" in draft.tables[JOINT]["configure_pdos"].how


def test_without_that_word_nothing_is_written_and_the_gateway_maps_it(
    draft: Draft, bench: CanBench, channel: str
) -> None:
    with HomingDrive(channel, NODE, objects=tpdos()) as drive:
        run(nodes.mapping(draft, bench, Axis(NODE), TOLD, "left_knee"), answering("n"))
        assert drive.writes == []
    assert draft.value(JOINT, "configure_pdos") is True


@pytest.mark.parametrize("aborted", [(0x1010, 1), (0x1A00, 1)])
def test_a_drive_that_refuses_is_told_and_left_to_the_gateway(
    draft: Draft, bench: CanBench, channel: str, aborted: tuple[int, int]
) -> None:
    with HomingDrive(channel, NODE, objects=tpdos(), aborts={aborted: 0x0800_0020}):
        run(nodes.mapping(draft, bench, Axis(NODE), TOLD, "left_knee"), hands := answering("y"))
    assert hands.heard("It was not taken, or not stored")
    assert draft.value(JOINT, "configure_pdos") is True
