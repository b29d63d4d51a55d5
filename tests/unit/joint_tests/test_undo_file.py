"""What one that was cut off has left in its drive is put back by the next one, or that does not begin."""

from collections.abc import Callable, Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from drivers.errors import DeviceTimeout, Mismatch
from gateway.commission.bench import Bench
from gateway.commission.dialogue import Say
from gateway.joint_test.limits import NotAllowed
from gateway.joint_test.undo_file import OriginalValue, Unfinished, changes, keep, put_right, read

NODE = 2
LEFT = Unfinished(
    "left_knee",
    "main",
    NODE,
    "2026-11-23T10:00:00Z",
    "Ada",
    (OriginalValue(0x6060, 1, 3, 8), OriginalValue(0x60B0, 4, -100, 0), OriginalValue(0x60B2, 2, 5, 0)),
)
KNEE = "left_knee"
KNEE = "left_knee"
JOINTS = {KNEE: SimpleNamespace(bus="main", node_id=NODE)}
BEFORE = {0x6060: b"\x03", 0x60B0: (-100).to_bytes(4, "little", signed=True), 0x60B2: b"\x05\x00"}
CUT_OFF = {0x6060: b"\x08", 0x60B0: bytes(4), 0x60B2: bytes(2)}


class Drive:
    """A bench with one drive; `broken` is what happens where it is written to."""

    def __init__(self, objects: Mapping[int, bytes], broken: Exception | None = None) -> None:
        self.objects = dict(objects)
        self.written: list[int] = []
        self._broken = broken

    def read(self, node: int, index: int, subindex: int = 0) -> bytes | None:
        assert (node, subindex) == (NODE, 0)
        return self.objects.get(index)

    def write(self, node: int, index: int, subindex: int, data: bytes) -> None:
        assert (node, subindex) == (NODE, 0)
        if self._broken is not None:
            raise self._broken
        self.objects[index] = data
        self.written.append(index)


def run(
    path: Path, drive: Drive, joints: Mapping[str, Any] = JOINTS, tell: Callable[..., object] | None = None
) -> str:
    talk = put_right(path, {"main": cast("Bench", drive)}, joints, tell or (lambda *_, **__: None))
    return "\n".join(one.text for one in talk if isinstance(one, Say))


@pytest.fixture
def path(tmp_path: Path) -> Path:
    keep(tmp_path / "joint-test.json", LEFT)
    return tmp_path / "joint-test.json"


def test_what_it_changes_is_known_before(tmp_path: Path) -> None:
    before = {"0x6060:0": 3, "0x60B0:0": -100, "0x60B1:0": 0, "0x60B2:0": 5, "0x6065:0": 9}
    assert changes(before, 8, 0) == LEFT.changes
    assert changes({"0x6060:0": 10, "0x60B2:0": 0}, 10, 0) == ()
    assert changes({"0x6860:0": 1}, 10, 0x800) == (OriginalValue(0x6860, 1, 1, 10),)


def test_nothing_left_is_nothing_to_say(tmp_path: Path) -> None:
    assert run(tmp_path / "joint-test.json", Drive(CUT_OFF)) == ""


def test_all_of_it_is_put_back_and_told(path: Path) -> None:
    told: list[tuple[str, dict[str, Any]]] = []
    drive = Drive(CUT_OFF)
    said = run(path, drive, tell=lambda what, **more: told.append((what, more)))
    assert drive.objects == BEFORE
    assert "Ada began at 2026-11-23T10:00:00Z was cut off" in said
    assert told[0][0] == "joint test taken back"
    assert told[0][1]["outcome"] == dict.fromkeys(("0x6060:0", "0x60B0:0", "0x60B2:0"), "put back")
    assert read(path) is None


def test_what_somebody_has_changed_since_is_left_alone(path: Path) -> None:
    drive = Drive({**CUT_OFF, 0x6060: b"\x01", 0x60B0: BEFORE[0x60B0]})
    said = run(path, drive)
    assert drive.written == [0x60B2]
    assert "0x6060:0: left alone: somebody has changed it since, to 01" in said
    assert "0x60B0:0: as before" in said


@pytest.mark.parametrize("error", [DeviceTimeout("no answer"), Mismatch("it holds 07")])
def test_what_the_drive_does_not_confirm_is_left_for_the_next_time(path: Path, error: Exception) -> None:
    with pytest.raises(NotAllowed, match="could not be put back"):
        run(path, Drive(CUT_OFF, error))
    assert read(path) == LEFT


@pytest.mark.parametrize(
    "joints",
    [
        {},
        {KNEE: SimpleNamespace(bus="main", node_id=3)},
        {KNEE: SimpleNamespace(bus="b", node_id=2)},
    ],
)
def test_a_joint_that_is_elsewhere_now_is_not_written_to(path: Path, joints: Mapping[str, Any]) -> None:
    drive = Drive(CUT_OFF)
    with pytest.raises(NotAllowed, match="no longer has the left knee there"):
        run(path, drive, joints)
    assert drive.written == []


@pytest.mark.parametrize("damage", [b"", b"{", b"[1]", b"\xff", b'{"joint": "left_knee"}', b"[" * 100_000])
def test_where_nobody_can_tell_nothing_begins(path: Path, damage: bytes) -> None:
    path.write_bytes(damage)
    with pytest.raises(NotAllowed, match="then remove"):
        run(path, Drive(CUT_OFF))
    assert path.exists()


def test_what_cannot_be_journaled_is_tried_again(path: Path) -> None:
    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    with pytest.raises(OSError, match="No space"):
        run(path, Drive(CUT_OFF), tell=full)
    assert read(path) == LEFT
