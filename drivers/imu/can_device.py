"""A trunk IMU on a CAN bus that sends frames of its own, outside of CANopen."""

import threading
from pathlib import Path

from drivers.bus.bus import BusUser, CanBus
from drivers.bus.frames import wire_id
from drivers.imu.can import FORMATS
from drivers.imu.settings import CanImuSettings
from drivers.imu.trunk import TrunkImu
from drivers.samples import Quality


class CanImu(TrunkImu, BusUser):
    """An IMU on a CAN bus (a `Component`); it is heard, never asked."""

    def __init__(self, name: str, settings: CanImuSettings, bus: CanBus, beside: Path | None = None) -> None:
        self._format = FORMATS[settings.format]
        super().__init__(name, settings, self._format.conventions, settings.attitude, beside)
        self._bus = bus
        self._label = f"0x{settings.can_id:03X}"
        self._can_id = wire_id(settings.can_id)
        self._lock = threading.Lock()  # frames come in the bus's thread
        self._started = False
        self._frames = self._foreign = 0

    def start(self) -> None:
        if self._started:
            return
        self._started = True
        self._freshness.reset()
        self._bus.subscribe(self._can_id, self._on_frame)
        self._bus.hold(self)

    def stop(self) -> None:
        with self._lock:
            self._started = False
        self._bus.unsubscribe(self._can_id, self._on_frame)
        self._bus.release(self)
        self._forget()

    def quality(self, now_ns: int) -> Quality:
        return self._quality(
            now_ns,
            self._bus.trouble or self._silence(),
            {"frames": self._frames, "malformed": self._foreign, "bus_opened": self._bus.opened},
        )

    def bus_closed(self) -> None:
        with self._lock:
            self._forget()

    def _on_frame(self, stamp_ns: int, data: bytes) -> None:
        frame = self._format.decode(data)
        with self._lock:
            if frame is None:
                self._foreign += 1
            elif self._started:
                self._frames += 1
                self._take(frame, stamp_ns)

    def _silence(self) -> str:
        if self._foreign and not self._frames:
            return (
                f"frames {self._label} on bus {self._bus.name} are not {self._format.maker}'s: another "
                "device has this identifier, correct `can_id`"
            )
        return (
            f"no frame {self._label} comes on bus {self._bus.name}: check the sensor's power, its bit rate, "
            "and `can_id` against the identifier set in it"
        )
