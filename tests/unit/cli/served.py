"""A gateway over fake devices, and `gwrms` typed at it."""

import io

import pytest

from gateway.main import main
from tests.unit.gateway.harness import Bench

EDS = '\nparameters = "eds"\nrelease = ["profile_*"]\n'
STEP, CYCLE, TORQUE, VELOCITY = (0x2001, 0), (0x2002, 0), (0x6072, 0), (0x6081, 0)


class Served:
    def __init__(self, bench: Bench, address: str) -> None:
        self.bench = bench
        self.address = address

    def run(self, *arguments: str) -> int:
        return main([*arguments, "--robot", self.address])

    def gait(self, key: tuple[int, int]) -> int:
        return int.from_bytes(self.bench.gait.node.objects[key], "little")

    def left(self, key: tuple[int, int]) -> int:
        return int.from_bytes(self.bench.left.node.objects[key], "little")


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def lines(capsys: pytest.CaptureFixture[str]) -> list[list[str]]:
    return [line.split() for line in capsys.readouterr().out.splitlines()]
