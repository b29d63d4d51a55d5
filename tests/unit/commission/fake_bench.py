"""A bus of drives that a test bends by hand, switches on, and takes away."""

from collections.abc import Callable, Collection
from contextlib import AbstractContextManager
from dataclasses import dataclass, field

from drivers.bus.interfaces.controller_state import BusState
from drivers.errors import DeviceTimeout
from drivers.joint.settings import JointSettings
from drivers.scan.identification import Axis as ToldAxis
from drivers.scan.identification import NodeAnswers
from drivers.scan.scan import ScanResult
from drivers.scan.traffic import Traffic
from eds import Description
from gateway.commission.dialogue import Ask
from gateway.commission.power import Power

OFF, ON = 0x0250, 0x0237  # switch on disabled, operation enabled
SHIPPED_DRIVE = (0x0, 0x4A44_0001)


@dataclass
class FakeDrive:
    """What a drive holds; `there` is whether it answers."""

    counts: int = 0
    statusword: int = OFF
    there: bool = True
    serial_number: int = 1
    objects: dict[tuple[int, int], int] = field(
        default_factory=lambda: {
            (0x1017, 0): 100,
            (0x608F, 1): 4096,
            (0x608F, 2): 1,
            (0x6091, 1): 100,
            (0x6091, 2): 1,
            (0x6075, 0): 5000,
            (0x6076, 0): 400,
        }
    )


class FakeBench:
    """Drives by node id."""

    def __init__(self, **drives: FakeDrive) -> None:
        self.drives = {int(name.removeprefix("node_")): drive for name, drive in drives.items()}

    def nodes(self) -> ScanResult:
        told: dict[int, NodeAnswers | str] = {
            node: _told(drive) for node, drive in self.drives.items() if drive.there
        }
        return ScanResult(1.0, Traffic(), 0.0, None, 0, BusState.ACTIVE, None, told, frozenset())

    def read(self, node: int, index: int, subindex: int = 0) -> bytes | None:
        drive = self.drives[node]
        if not drive.there:
            raise DeviceTimeout(f"node {node} does not answer")
        fixed = {(0x6041, 0): drive.statusword, (0x6064, 0): drive.counts}
        value = (fixed | drive.objects).get((index, subindex))
        return None if value is None else value.to_bytes(4, "little", signed=True)

    def write(self, node: int, index: int, subindex: int, data: bytes) -> None:
        raise AssertionError(f"nobody agreed to write {index:04X}h of node {node}")

    def map(self, node: int, axis: int, description: Description) -> str:
        raise AssertionError(f"nobody agreed to map PDOs of node {node}, axis {axis}, {description.product}")

    def power(
        self, joint: JointSettings, description: Description, others: Collection[int] = ()
    ) -> AbstractContextManager[Power]:
        raise AssertionError(f"nobody agreed to power for node {joint.node_id}, {description.product}")


def _told(drive: FakeDrive) -> NodeAnswers:
    vendor, product = SHIPPED_DRIVE
    axis = ToldAxis(0, None, None)
    return NodeAnswers(
        0x20192, 0, "drive", None, None, vendor, product, None, drive.serial_number, 100, (axis,), ()
    )


class Hands:
    """Does the first of `does` whose words are in the question; each has one turn."""

    def __init__(self, *does: tuple[str, Callable[[], str]]) -> None:
        self.read: list[str] = []
        self._does = list(does)

    def say(self, text: str) -> None:
        self.read.append(text)

    def moving(self, text: str) -> str:
        raise AssertionError(f"nobody agreed to a motion: {text}")

    def ask(self, question: Ask) -> str:
        self.read.append(question.text)
        for one in self._does:
            if one[0] in question.text:
                self._does.remove(one)
                return one[1]()
        raise EOFError

    def heard(self, words: str) -> bool:
        return any(words in line for line in self.read)
