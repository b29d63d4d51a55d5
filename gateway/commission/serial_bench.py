"""Serial ports as commissioning reaches them: the drivers' own devices, opened for a look."""

import threading
import time
from collections.abc import Sequence
from pathlib import Path

from drivers.build_context import BuildContext
from drivers.cli.listen import best, listen, nothing
from drivers.errors import Unavailable
from drivers.identify import format_of
from drivers.imu.build import build_imu
from drivers.imu.rotation import Vector
from drivers.imu.settings import ImuSettings
from drivers.insole.device import layout_of, line_for
from drivers.insole.formats import FORMATS as INSOLES
from drivers.insole.frame import InsoleFrame
from drivers.insole.settings import InsoleSettings
from drivers.samples import ComponentState
from gateway.commission.sensors import Sensor

LOOK_S = 3.0
_HERE = Path("robot.toml")  # no file is looked for beside it


class SerialPorts:
    """The real ones."""

    def sensor(self, port: str) -> Sensor:
        heard = list(listen(port))
        one = best(heard)
        if one.match is None:
            raise Unavailable(nothing(port, heard))
        name = one.match.format_name
        return Sensor(port, one.baudrate, name, name in INSOLES, one.match.layout)

    def loads(self, insoles: Sequence[Sensor]) -> dict[str, float]:
        watches = [_Swing(one) for one in insoles]
        for watch in watches:
            watch.start()
        try:
            threading.Event().wait(LOOK_S)
        finally:
            for watch in watches:
                watch.stop()
        return {watch.port: watch.swing for watch in watches}

    def up(self, imu: Sensor) -> Vector:
        settings = ImuSettings(port=imu.port, baudrate=imu.baudrate, format=imu.format, axes=("x", "y", "z"))
        device = build_imu("trunk", settings, BuildContext(_HERE, recognise=format_of))
        device.start()
        try:
            threading.Event().wait(LOOK_S)
            quality = device.quality(time.monotonic_ns())
            ups = device.ups_as_mounted()
        finally:
            device.stop()
        if quality.state is not ComponentState.OK or not ups:
            raise Unavailable(quality.problem or f"{imu.port}: no attitude has come")
        x, y, z = (sum(part) / len(ups) for part in zip(*ups, strict=True))
        return x, y, z


class _Swing:
    """Range of an insole's whole load, in its own counts."""

    def __init__(self, sensor: Sensor) -> None:
        self.port = sensor.port
        settings = InsoleSettings(port=sensor.port, baudrate=sensor.baudrate, format=sensor.format)
        self._line = line_for(settings, layout_of(sensor.format, sensor.layout), format_of)
        self._least: float | None = None
        self._most = 0.0

    @property
    def swing(self) -> float:
        return 0.0 if self._least is None else self._most - self._least

    def start(self) -> None:
        self._line.start(self)

    def stop(self) -> None:
        self._line.stop(self)

    def received(self, frames: Sequence[InsoleFrame], _stamp_ns: int) -> None:
        for frame in frames:
            total = sum(cell for cell in frame.cells if cell is not None)
            self._most = total if self._least is None else max(self._most, total)
            self._least = total if self._least is None else min(self._least, total)

    def disconnected(self) -> None:
        """Note that the port went away; its values stay."""
