"""The common part of all trunk IMUs, however wired: frames in, channels and quality out."""

from collections.abc import Mapping
from pathlib import Path

from drivers.calibration_file import mark
from drivers.component import ComponentKind
from drivers.findings import active_findings
from drivers.frame_shares import beside
from drivers.freshness import Freshness, silence_text
from drivers.imu import zero
from drivers.imu.conventions import Conventions
from drivers.imu.frame import ImuFrame
from drivers.imu.motion import UNITS, TrunkMotion, channels
from drivers.imu.plausibility import ImuCheck
from drivers.imu.rotation import IDENTITY, Quaternion, Vector
from drivers.imu.settings import Attitude, MountedSettings
from drivers.latest import Latest
from drivers.samples import ComponentState, Quality


class TrunkImu:
    """Base of the IMUs.

    Channels, in trunk axes (REP-103: x forward, y left, z up): `tilt_forward` (rad, positive leaning
    forward), `tilt_side` (rad, positive leaning left), `acceleration_x|y|z` (m/s², specific force: +g upwards
    at rest), `angular_velocity_x|y|z` (rad/s), `orientation_w|x|y|z` (trunk to a world whose z points up),
    `temperature` (°C). What the device does not send stays null.

    `beside` is the folder that a file named in the settings is looked for in.

    Raises:
        SettingsError: the configured axes are no right-handed frame, or the zero's file is wrong.

    """

    kind = ComponentKind.IMU
    channel_count = len(UNITS)

    def __init__(
        self,
        name: str,
        settings: MountedSettings,
        conventions: Conventions,
        attitude: Attitude,
        beside: Path | None,
    ) -> None:
        self.name = name
        self.channels = channels(name, self.channel_count)
        self.latest = Latest(name, self.channels, settings.stale_after_s)
        self.check = ImuCheck(name)
        file = None if settings.zero is None else (beside or Path()) / settings.zero
        stored = IDENTITY if file is None else zero.load(file)
        self.calibration = "" if file is None else mark(file)
        self._motion = TrunkMotion(name, settings, conventions, attitude, stored)
        self._freshness = Freshness(settings.stale_after_s, settings.lost_after_s)

    def start(self) -> None:
        raise NotImplementedError

    def stop(self) -> None:
        raise NotImplementedError

    def quality(self, now_ns: int) -> Quality:
        raise NotImplementedError

    def zero_now(self) -> Quaternion:
        """Count tilt from the present posture (not stored; `zero.text` makes the file).

        Raises:
            NotUpright: there is no attitude, the trunk moves, or it is far from upright.

        """
        measured = zero.measure(self._motion.ups_as_mounted())
        self._motion.set_zero(measured)
        return measured

    def ups_as_mounted(self) -> list[Vector]:
        """Return the world's up in the axes of the trunk without a zero, of the last second or so."""
        return self._motion.ups_as_mounted()

    def _take(self, frame: ImuFrame, stamp_ns: int) -> None:
        """Take a frame of `stamp_ns`."""
        felt = self._motion.felt(frame, stamp_ns)
        if felt.indices:
            self.check.update(stamp_ns, felt.acceleration, felt.angular_velocity, felt.up)
            self._freshness.seen(stamp_ns)
            self.latest.update(stamp_ns, felt.indices, felt.values)

    def _forget(self) -> None:
        """Nothing that the device said before is true any more."""
        self.latest.clear()
        self._freshness.disconnected()
        self._motion.restart()
        self.check.restart()

    def _quality(self, now_ns: int, silence: str | None, counters: Mapping[str, int]) -> Quality:
        """`silence` is why nothing comes, in words; it matters only where nothing comes."""
        state, age_ms = self._freshness.state(now_ns)
        counters = {**counters, "stale": self._freshness.stale}
        if state is not ComponentState.OK:
            return Quality(state, age_ms, silence or silence_text(age_ms), counters)
        findings = active_findings([self.check])
        return beside(
            Quality(ComponentState.FAULT if findings else state, age_ms, None, counters), findings, now_ns
        )
