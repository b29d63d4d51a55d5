"""A simulated walk as somebody would have recorded it: CAN logs by python-can, serial bytes, the truth."""

import json
from dataclasses import dataclass
from pathlib import Path

import can

from hil_sim.robot import SimulatedRobot
from tests.unit.hil_sim.listener import Listener

SECONDS = 3.0


@dataclass(frozen=True)
class Recording:
    """In `folder` lie walk.log, walk.asc, walk.blf, the captures by the sensors' names, and robot.toml."""

    folder: Path
    messages: list[can.Message]
    truth: list[dict[str, float]]

    @property
    def log(self) -> Path:
        return self.folder / "walk.log"

    @property
    def captures(self) -> dict[str, Path]:
        return {name: self.folder / f"{name}.bin" for name in ("left_insole", "right_insole", "trunk")}


def record(folder: Path) -> Recording:
    """Let a robot walk as fast as it goes; its robot.toml names the virtual channel `str(folder)`."""
    truth = folder / "truth.jsonl"
    robot = SimulatedRobot(folder, virtual_channel=str(folder), speed=None, truth=truth)
    messages: list[can.Message] = []
    with can.Bus(interface="virtual", channel=str(folder), preserve_timestamps=True) as bus:
        robot.open()
        lines = robot.exoskeleton.sensors.lines
        heard = {name: bytearray() for name in lines}
        for name, line in lines.items():
            line.port = Listener(line.baudrate, heard[name].extend)
        robot.loop.each_turn(lambda: messages.extend(iter(lambda: bus.recv(timeout=0), None)))
        robot.run(SECONDS)
        robot.close()
    _keep_frames(folder, messages)
    for name, line in lines.items():
        keep_bytes(folder / f"{name}.bin", bytes(heard[name]), line.baudrate)
    head, *rows = (json.loads(line) for line in truth.read_text(encoding="utf-8").splitlines())
    return Recording(folder, messages, [dict(zip(head["columns"], row, strict=True)) for row in rows])


def _keep_frames(folder: Path, messages: list[can.Message]) -> None:
    for suffix in (".log", ".asc", ".blf"):
        with can.Logger(folder / f"walk{suffix}") as logger:
            for message in messages:
                logger(message)


def keep_bytes(file: Path, data: bytes, baudrate: int, seconds: float = SECONDS) -> None:
    """A capture that begins when the robot is switched on."""
    file.write_bytes(data)
    about = {"baudrate": baudrate, "seconds": seconds, "began_s": 0.0}
    file.with_name(file.name + ".json").write_text(json.dumps(about), encoding="utf-8")
