"""A whole robot in simulated time, seen from outside: by one more node on its bus, by readers of its ports.

Nothing here asks the simulator what it did. Identifiers and commands are those of CiA 301 and CiA 402.
"""

from pathlib import Path

import can

from hil_sim.bus.can_bus import Frame
from hil_sim.clock import SECOND_NS
from hil_sim.exoskeleton import JOINTS, Exoskeleton, Scenario
from hil_sim.faults.injector import Faults

KNEE = JOINTS["left_knee"]
GAIT = 16
STATE_MASK, ENABLED, IN_FAULT = 0x6F, 0x27, 0x08
_UP_S = 0.6  # the drives are enabled, the motion begins
_A_MOMENT_S = 0.05
_ANSWER_S = 0.05


class Listener:
    """Whoever reads a serial port, at the rate that the sensor has."""

    def __init__(self, baudrate: int) -> None:
        self.baudrate = baudrate
        self.plugged = True
        self.data = b""

    def plug(self, plugged: bool) -> None:
        self.plugged = plugged

    def write(self, data: bytes) -> None:
        self.data += data

    def take(self) -> bytes:
        """What has come since the last time."""
        data, self.data = self.data, b""
        return data


class Outside:
    """The robot, its faults, a node that hears its bus and, with `sensors`, a listener on each port."""

    def __init__(
        self,
        folder: Path,
        scenario: Scenario = Scenario.WALK,
        seed: int = 0,
        kind: type[Exoskeleton] = Exoskeleton,
        *,
        sensors: bool = False,
    ) -> None:
        self.robot = kind(scenario, seed)
        self.faults = Faults(self.robot, folder, seed)
        self.ports = {name: Listener(line.baudrate) for name, line in self.robot.sensors.lines.items()}
        if sensors:  # what nobody hears costs nothing
            for name, line in self.robot.sensors.lines.items():
                line.port = self.ports[name]
        self.messages: list[can.Message] = []
        self._came: list[can.Message] = []
        self.robot.bus.attach(self, self._hear, self._hear_error)
        self.robot.power_on()
        self.run(_UP_S)

    def mend(self) -> None:
        """End every fault, and let nobody wait for what came before."""
        self.faults.clear()
        self.run(_A_MOMENT_S)
        self.messages.clear()

    def close(self) -> None:
        self.faults.clear()

    @property
    def now_s(self) -> float:
        return self.robot.clock.now_s

    def run(self, seconds: float) -> list[can.Message]:
        """Let the robot live on; what came on the bus meanwhile."""
        self.robot.clock.run_until(self.robot.clock.now_ns + round(seconds * SECOND_NS))
        came, self._came = self._came, []
        self.messages += came
        return came

    def send(self, cob_id: int, data: bytes) -> None:
        self.robot.bus.send(Frame(cob_id, data), self)

    def _hear(self, frame: Frame, _sender: object) -> None:
        self._came.append(
            can.Message(
                arbitration_id=frame.cob_id,
                data=frame.data,
                is_extended_id=frame.extended,
                is_remote_frame=frame.remote,
                timestamp=self.now_s,
            )
        )

    def _hear_error(self, error_class: int) -> None:
        self._came.append(can.Message(arbitration_id=error_class, is_error_frame=True, timestamp=self.now_s))

    def ask(self, node: int, request: bytes, seconds: float = _ANSWER_S) -> list[bytes]:
        """An SDO request; the answers that come in time."""
        self.send(0x600 + node, request)
        return of(self.run(seconds), 0x580 + node)

    def read(self, node: int, index: int, subindex: int = 0) -> int:
        """An expedited upload, unsigned."""
        (answer,) = self.ask(node, b"\x40" + index.to_bytes(2, "little") + bytes([subindex, 0, 0, 0, 0]))
        assert answer[0] & 0xE3 == 0x43, answer.hex(" ")
        return int.from_bytes(answer[4 : 8 - (answer[0] >> 2 & 3)], "little")

    def write(self, node: int, index: int, value: int, size: int, subindex: int = 0) -> bytes:
        """An expedited download; the answer."""
        head = bytes([0x23 | (4 - size) << 2]) + index.to_bytes(2, "little") + bytes([subindex])
        (answer,) = self.ask(node, head + value.to_bytes(4, "little"))
        return answer


def of(messages: list[can.Message], cob_id: int) -> list[bytes]:
    """The data of the frames with this identifier."""
    return [bytes(message.data) for message in messages if is_frame(message, cob_id)]


def is_frame(message: can.Message, cob_id: int) -> bool:
    return message.arbitration_id == cob_id and not message.is_error_frame


def errors(messages: list[can.Message]) -> int:
    """How many error frames there were."""
    return sum(message.is_error_frame for message in messages)


def statuswords(messages: list[can.Message], node: int) -> list[int]:
    """6041h as TPDO 1 brings it: first in the drive's default mapping."""
    return [int.from_bytes(data[:2], "little") for data in of(messages, 0x180 + node)]


def positions(messages: list[can.Message], node: int) -> list[int]:
    """6064h as TPDO 1 brings it: second in the drive's default mapping."""
    return [int.from_bytes(data[2:6], "little", signed=True) for data in of(messages, 0x180 + node)]
