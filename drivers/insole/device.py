"""One foot's insole: frames of its line become pressure, force and centre of pressure."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from drivers.calibration_file import mark
from drivers.component import ComponentKind
from drivers.errors import SettingsError
from drivers.findings import active_findings
from drivers.frame_shares import beside, saturated_frames
from drivers.freshness import Freshness, silence_text
from drivers.insole import calibration as calibrations
from drivers.insole import layout as layouts
from drivers.insole.calibration import Cells
from drivers.insole.foot import FEET, Foot
from drivers.insole.formats import FORMATS
from drivers.insole.frame import InsoleFrame
from drivers.insole.layout import Layout
from drivers.insole.load import Stance, load_of
from drivers.insole.plausibility import FeetCheck, FootCheck, SwapCheck
from drivers.insole.settings import InsoleSettings
from drivers.latest import Latest
from drivers.line import Line, Recognise, unrecognised
from drivers.reader_stalls import ReaderStalls
from drivers.samples import Channel, ComponentState, Finding, Quality
from drivers.sensor_losses import Losses

USUAL_LAYOUT = "insole-16"
CONTACT = {0: "in the air", 1: "on the ground"}


class Insole:
    """An insole on a serial port (a `Component`).

    Channels: `force` (N), `cop_x` and `cop_y` (m; foot frame: origin at the heel, x forward, y left; null
    below the force threshold), `cell_0` … (Pa), `contact` (0 or 1), `load_share` (0 to 1 of what both feet
    carry; null without the other foot).

    `beside` is the folder that files named in the settings are looked for in; `line` is given where two feet
    share a port.

    Raises:
        SettingsError: the layout or calibration does not exist or is wrong.

    """

    kind = ComponentKind.INSOLE

    def __init__(
        self,
        name: str,
        settings: InsoleSettings,
        line: Line[InsoleFrame] | None = None,
        beside: Path | None = None,
    ) -> None:
        self.name = name
        self.settings = settings
        self.foot: Foot | None = settings.side(name)
        layout = layout_of(settings.format, settings.layout, beside)
        self.layout = layout if self.foot is None else layout.for_foot(self.foot)
        if not layout.cells:
            raise SettingsError(
                f"[insole.{name}]: layout {layout.name} has no `cells`: add their places and areas"
            )
        self.line = line if line is not None else line_for(settings, layout)
        self.channels = _channels(name, len(layout.cells))
        self.latest = Latest(name, self.channels, settings.stale_after_s)
        self.other: Insole | None = None  # the other foot's, where there is one
        self._cells = _calibration(settings, layout, beside)
        self.calibration = mark((beside or Path()) / settings.calibration) if settings.calibration else ""
        self.hip_velocity: Callable[[int], float | None] | None = None  # of the same leg, at a time
        self._stance = Stance(settings.force_threshold)
        self.check = FootCheck(name, len(layout.cells))
        self._feet_check = FeetCheck(name)
        self._swap_check = SwapCheck()
        self._losses, self._saturated_share = Losses(self.line.standstill), saturated_frames()
        self._indices = tuple(range(len(self.channels)))
        self._freshness = Freshness(settings.stale_after_s, settings.lost_after_s)
        self._fault: str | None = None  # what the device's own frames say is wrong
        self._foreign = 0  # frames of the other foot since the last of ours
        self._taken = self._saturated = 0
        self._clock_spec = FORMATS[settings.format].clock
        self._clock = self._clock_spec.make()

    def start(self) -> None:
        self._freshness.reset()
        self.disconnected()
        self._taken = self._saturated = 0
        self.line.start(self)

    def stop(self) -> None:
        self.line.stop(self)
        self.disconnected()

    def follow_hip(self, hip: Latest) -> None:
        """Judge left and right by the hip of the same leg, where it has a velocity (flexion positive)."""
        places = [index for index, channel in enumerate(hip.channels) if channel.quantity == "velocity"]
        if places:
            self.hip_velocity = lambda now_ns: hip.read(places[0], now_ns)[0]

    def quality(self, now_ns: int) -> Quality:
        state, age_ms = self._freshness.state(now_ns)
        if state is ComponentState.OK:
            wrong = (*self._implausible(), *active_findings([self._saturated_share]))
            state = ComponentState.FAULT if self._fault is not None or wrong else state
            findings = (*wrong, *self._losses.findings)
            return beside(Quality(state, age_ms, self._fault, self._counters()), findings, now_ns)
        silence = self.line.problem(now_ns) or self._fault or self._wrong_foot()
        return Quality(state, age_ms, silence or silence_text(age_ms), self._counters())

    def _implausible(self) -> tuple[Finding, ...]:
        """Return the first thing that cannot be, for what else is told follows from it."""
        return (*self.check.findings, *active_findings((self._feet_check, self._swap_check)))[:1]

    def received(self, frames: Sequence[InsoleFrame], stamp_ns: int) -> None:
        """Frames of the line; called in the port's thread."""
        for frame in frames:
            self._take(frame, stamp_ns)
        self._saturated_share.update(stamp_ns, self._saturated, self._taken)
        numbered = bool(frames) and frames[-1].sequence is not None
        self._losses.update(stamp_ns, self.line.parser.counters, numbered=numbered)

    def _take(self, frame: InsoleFrame, stamp_ns: int) -> None:
        if frame.late:
            return
        if self.foot is not None and frame.foot is not None and frame.foot != self.foot:
            self._foreign += 1
            return
        if frame.ticks is not None:
            taken_ns = self._clock.stamp(frame.ticks, stamp_ns)
            if taken_ns is None:
                return
            stamp_ns = taken_ns
        self._foreign = 0
        self._taken += 1
        self._fault = self._fault_in(frame)
        self._freshness.seen(stamp_ns)
        self._update(stamp_ns, self._pressures(frame))

    def disconnected(self) -> None:
        """Forget all values: the port went away."""
        self.latest.clear()
        self._freshness.disconnected()
        self._fault, self._foreign = None, 0
        self._clock = self._clock_spec.make()
        self.check.restart()
        self._feet_check.restart()
        self._swap_check.restart()
        self._losses.restart()
        self._saturated_share.restart()

    def _update(self, stamp_ns: int, pressures: tuple[float | None, ...]) -> None:
        load = load_of(pressures, self.layout, self.settings.force_threshold)
        contact = self._stance.contact(load.force)
        others = None if self.other is None else self.other.latest.read(0, stamp_ns)[0]
        share = self._stance.share(load.force, others)
        self.latest.update(stamp_ns, self._indices, (*load, *pressures, contact, share))
        if self.check.is_due(stamp_ns):
            self.check.update(stamp_ns, pressures, load.force)
            if self.other is not None:
                self._check_against(self.other, stamp_ns, load.force, others)

    def _check_against(
        self, other: "Insole", stamp_ns: int, force: float | None, others: float | None
    ) -> None:
        self._feet_check.update(stamp_ns, self.check.landings, other.check.landings)
        if self.hip_velocity is None or other.hip_velocity is None or force is None or others is None:
            return
        own_hip, other_hip = self.hip_velocity(stamp_ns), other.hip_velocity(stamp_ns)
        if own_hip is not None and other_hip is not None:
            self._swap_check.update(stamp_ns, force - others, own_hip - other_hip)

    def _pressures(self, frame: InsoleFrame) -> tuple[float | None, ...]:
        count = len(self.layout.cells)
        if len(frame.cells) != count:
            return (None,) * count
        if frame.calibrated:
            self._saturated += frame.saturated
            return frame.cells
        if self._cells is None:
            return (None,) * count
        self._saturated += frame.saturated or self._cells.saturated(frame.cells)
        return self._cells.pressures(frame.cells)

    def _fault_in(self, frame: InsoleFrame) -> str | None:
        if len(frame.cells) != len(self.layout.cells):
            return (
                f"{self.name} sends {len(frame.cells)} cells and the layout {self.layout.name} has "
                f"{len(self.layout.cells)}: correct `layout` in [insole.{self.name}]"
            )
        if not frame.calibrated and self._cells is None:
            return (
                f"{self.name} sends the converter's counts and has no calibration: pressure is unknown "
                f"(gwrms calibrate insole measures one)"
            )
        if frame.missing:
            return (
                f"{self.name} reports missing cells: check its cells' connector; force is unknown meanwhile"
            )
        return None

    def _wrong_foot(self) -> str | None:
        if not self._foreign:
            return None
        other = FEET[self.foot == "left"]
        return (
            f"{self.line.path} sends frames of the {other} foot only: the two insoles' ports are swapped, "
            f"or [insole.{self.name}] needs foot = {other!r}"
        )

    def _counters(self) -> Mapping[str, int]:
        return {
            **self.line.parser.counters.as_dict(),
            "saturated": self._saturated,
            "stale": self._freshness.stale,
            "reconnects": self.line.reconnects,
            "clock_restarts": self._clock.restarts,
        }


def layout_of(format_name: str, layout_name: str | None, beside: Path | None = None) -> Layout:
    """Return the layout of that name; without one, the device's own, or the usual one.

    Raises:
        SettingsError: there is none, or it is wrong; the message names file and key.

    """
    own = FORMATS[format_name].layout
    if own is not None and layout_name is None:
        return own
    return layouts.load(layout_name or USUAL_LAYOUT, beside)


def line_for(
    settings: InsoleSettings,
    layout: Layout,
    recognise: Recognise = unrecognised,
    standstill: ReaderStalls | None = None,
) -> Line[InsoleFrame]:
    """Return the line that `settings` describe.

    Raises:
        SettingsError: the format needs a description that the layout does not have.

    """
    make_parser = FORMATS[settings.format].parser(layout)
    return Line(settings.port, settings.baudrate, settings.format, make_parser, recognise, standstill)


def _calibration(settings: InsoleSettings, layout: Layout, beside: Path | None) -> Cells | None:
    calibration = layout.calibration
    if settings.calibration is not None:
        calibration = calibrations.load((beside or Path()) / settings.calibration)
    return None if calibration is None else Cells(calibration, len(layout.cells))


def _channels(name: str, cells: int) -> tuple[Channel, ...]:
    units = {"force": "N", "cop_x": "m", "cop_y": "m"} | {f"cell_{cell}": "Pa" for cell in range(cells)}
    return (
        *(Channel(f"{name}.{quantity}", name, quantity, unit) for quantity, unit in units.items()),
        Channel(f"{name}.contact", name, "contact", "", CONTACT),
        Channel(f"{name}.load_share", name, "load_share", ""),
    )
