"""A trunk IMU on a serial port."""

from pathlib import Path

from drivers.component import Kind
from drivers.freshness import Freshness
from drivers.imu import zero
from drivers.imu.formats import FORMATS
from drivers.imu.frame import ImuFrame
from drivers.imu.motion import TrunkMotion, channels
from drivers.imu.plausibility import ImuCheck
from drivers.imu.rotation import IDENTITY, Quaternion
from drivers.imu.settings import ImuSettings
from drivers.latest import Latest
from drivers.line import Line
from drivers.samples import Quality, State


class Imu:
    """An IMU on a serial port (a `Component`).

    Channels, in trunk axes (REP-103: x forward, y left, z up): `tilt_forward` (rad, positive leaning
    forward), `tilt_side` (rad, positive leaning left), `acceleration_x|y|z` (m/s², specific force: +g upwards
    at rest), `angular_velocity_x|y|z` (rad/s), `orientation_w|x|y|z` (trunk to a world whose z points up),
    `temperature` (°C). What the device does not send stays null.

    `beside` is the folder that a file named in the settings is looked for in.

    Raises:
        SettingsError: the configured axes are no right-handed frame, or the zero's file is wrong.

    """

    kind = Kind.IMU

    def __init__(self, name: str, settings: ImuSettings, beside: Path | None = None) -> None:
        self.name = name
        self.settings = settings
        self.channels = channels(name)
        self.latest = Latest(name, self.channels, settings.stale_after_s)
        imu_format = FORMATS[settings.format]
        self.line = Line(settings.port, settings.baudrate, settings.format, imu_format.make_parser)
        self._clock_spec = imu_format.clock
        self._clock = imu_format.clock.make() if imu_format.clock else None
        stored = IDENTITY if settings.zero is None else zero.load((beside or Path()) / settings.zero)
        self._motion = TrunkMotion(name, settings, imu_format, stored)
        self.check = ImuCheck(name)
        self._freshness = Freshness(settings.stale_after_s, settings.lost_after_s)

    def start(self) -> None:
        self._freshness.reset()
        self.disconnected()
        self.line.start(self)

    def stop(self) -> None:
        self.line.stop(self)
        self.disconnected()

    def zero_now(self) -> Quaternion:
        """Count tilt from the present posture (not stored; `zero.text` makes the file).

        Raises:
            NotUpright: there is no attitude, the trunk moves, or it is far from upright.

        """
        measured = zero.measure(self._motion.ups_as_mounted())
        self._motion.set_zero(measured)
        return measured

    def quality(self, now_ns: int) -> Quality:
        state, age_ms = self._freshness.state(now_ns)
        problem = self.check.problem if state is State.OK else self.line.problem(now_ns)
        if state is State.OK and problem is not None:
            state = State.FAULT
        counters = self.line.parser.counters.as_dict()
        counters |= {"stale": self._freshness.stale, "reconnects": self.line.reconnects}
        return Quality(state, age_ms, problem, counters)

    def received(self, frame: ImuFrame, stamp_ns: int) -> None:
        """A frame of the line; called in the port's thread."""
        if frame.late:
            return
        if self._clock is not None and frame.ticks is not None:
            taken_ns = self._clock.stamp(frame.ticks, stamp_ns)
            if taken_ns is None:
                return
            stamp_ns = taken_ns
        felt = self._motion.felt(frame, stamp_ns)
        if felt.indices:
            self.check.update(stamp_ns, felt.acceleration, felt.angular_velocity, felt.up)
            self._freshness.seen(stamp_ns)
            self.latest.update(stamp_ns, felt.indices, felt.values)

    def disconnected(self) -> None:
        """The port went away: nothing that it said before is true any more."""
        self.latest.clear()
        self._freshness.disconnected()
        self._motion.restart()
        self.check.restart()
        self._clock = self._clock_spec.make() if self._clock_spec else None
