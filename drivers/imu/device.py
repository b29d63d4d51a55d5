"""A trunk IMU on a serial port."""

from collections.abc import Sequence
from pathlib import Path

from drivers.frame_shares import beside
from drivers.imu.formats import FORMATS
from drivers.imu.frame import ImuFrame, moments
from drivers.imu.settings import ImuSettings
from drivers.imu.trunk import TrunkImu
from drivers.line import Line, Recognise, unrecognised
from drivers.reader_stalls import ReaderStalls
from drivers.samples import ComponentState, Quality
from drivers.sensor_losses import Losses


class Imu(TrunkImu):
    """An IMU that streams over a serial port (a `Component`)."""

    def __init__(
        self,
        name: str,
        settings: ImuSettings,
        beside: Path | None = None,
        recognise: Recognise = unrecognised,
        standstill: ReaderStalls | None = None,
    ) -> None:
        imu_format = FORMATS[settings.format]
        super().__init__(name, settings, imu_format.conventions, settings.attitude, beside)
        self.line = Line(
            settings.port, settings.baudrate, settings.format, imu_format.parser, recognise, standstill
        )
        self._losses = Losses(self.line.standstill)
        self._clock_spec = imu_format.clock
        self._clock = imu_format.clock.make() if imu_format.clock else None

    def start(self) -> None:
        self._freshness.reset()
        self.disconnected()
        self.line.start(self)

    def stop(self) -> None:
        self.line.stop(self)
        self.disconnected()

    def quality(self, now_ns: int) -> Quality:
        counters = self.line.parser.counters.as_dict() | {"reconnects": self.line.reconnects}
        quality = self._quality(now_ns, self.line.problem(now_ns), counters)
        return (
            beside(quality, self._losses.findings, now_ns) if quality.state is ComponentState.OK else quality
        )

    def received(self, frames: Sequence[ImuFrame], stamp_ns: int) -> None:
        """Frames of the line; called in the port's thread."""
        for moment in frames if len(frames) == 1 else moments(frames):
            self._received(moment, stamp_ns)
        numbered = bool(frames) and frames[-1].sequence is not None
        self._losses.update(stamp_ns, self.line.parser.counters, numbered=numbered)

    def _received(self, frame: ImuFrame, stamp_ns: int) -> None:
        if frame.late:
            return
        if self._clock is not None and frame.ticks is not None:
            taken_ns = self._clock.stamp(frame.ticks, stamp_ns)
            if taken_ns is None:
                return
            stamp_ns = taken_ns
        self._take(frame, stamp_ns)

    def disconnected(self) -> None:
        """Note that the port went away."""
        self._forget()
        self._losses.restart()
        self._clock = self._clock_spec.make() if self._clock_spec else None
