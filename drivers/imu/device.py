"""A trunk IMU on a serial port."""

from drivers.component import Kind
from drivers.freshness import Freshness
from drivers.imu.formats import FORMATS
from drivers.imu.frame import ImuFrame
from drivers.imu.motion import TrunkMotion, channels
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

    Raises:
        SettingsError: the configured axes are no right-handed frame.

    """

    kind = Kind.IMU

    def __init__(self, name: str, settings: ImuSettings) -> None:
        self.name = name
        self.settings = settings
        self.channels = channels(name)
        self.latest = Latest(name, self.channels, settings.stale_after_s)
        imu_format = FORMATS[settings.format]
        self.line = Line(settings.port, settings.baudrate, settings.format, imu_format.make_parser)
        self._motion = TrunkMotion(name, settings, imu_format)
        self._freshness = Freshness(settings.stale_after_s, settings.lost_after_s)

    def start(self) -> None:
        self._freshness.reset()
        self.latest.clear()
        self.line.start(self)

    def stop(self) -> None:
        self.line.stop(self)
        self.disconnected()

    def quality(self, now_ns: int) -> Quality:
        state, age_ms = self._freshness.state(now_ns)
        problem = None if state is State.OK else self.line.problem(now_ns)
        counters = self.line.parser.counters.as_dict()
        counters |= {"stale": self._freshness.stale, "reconnects": self.line.reconnects}
        return Quality(state, age_ms, problem, counters)

    def received(self, frame: ImuFrame, stamp_ns: int) -> None:
        """A frame of the line; called in the port's thread."""
        indices, values = self._motion.values(frame)
        if frame.late or not indices:
            return
        self._freshness.seen(stamp_ns)
        self.latest.update(stamp_ns, indices, values)

    def disconnected(self) -> None:
        """The port went away: nothing that it said before is true any more."""
        self.latest.clear()
        self._freshness.disconnected()
