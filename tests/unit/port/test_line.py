"""A line on which no frame comes names the device that is there instead."""

import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from gateway import config
from gateway.modules.component.assembly import assemble
from tests.support.waiting import until
from tests.unit.imu.encode import witmotion
from tests.unit.insole.encode import Sender
from tests.unit.port.terminals import Terminal, send_until


@pytest.fixture
def terminal(tmp_path: Path) -> Iterator[Terminal]:
    terminal = Terminal(tmp_path / "port")
    terminal.plug_in()
    yield terminal
    terminal.unplug()


@pytest.mark.parametrize(
    ("table", "sent", "spoken"),
    [
        ("imu.trunk", Sender().frame([200] * 16), "insole-cobs"),
        ("insole.left_insole", witmotion(0x53, 0, 0, 0, 0), "witmotion"),
    ],
    ids=["imu", "insole"],
)
def test_another_device_on_a_port_is_named_by_its_format(
    terminal: Terminal, tmp_path: Path, table: str, sent: bytes, spoken: str
) -> None:
    file = tmp_path / "robot.toml"
    file.write_text(f'[robot]\nname = "exo"\n[{table}]\nport = "{terminal.path}"\n')
    component = assemble(config.load(file)).components[table.partition(".")[2]]

    def problem() -> str:
        return component.quality(time.monotonic_ns()).problem or ""

    component.start()
    try:
        until(lambda: "is being opened" not in problem(), "the port to open")
        send_until(
            terminal, sent, lambda: f"another device is there, which speaks {spoken}" in problem(), "its name"
        )
    finally:
        component.stop()
