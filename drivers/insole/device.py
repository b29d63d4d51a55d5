"""One foot's insole: frames of its line become pressure, force and centre of pressure."""

from collections.abc import Mapping

from drivers.component import Kind
from drivers.freshness import Freshness
from drivers.insole import layout as layouts
from drivers.insole.formats import FORMATS
from drivers.insole.frame import InsoleFrame
from drivers.insole.layout import Foot
from drivers.insole.load import load_of
from drivers.insole.settings import InsoleSettings
from drivers.latest import Latest
from drivers.line import Line
from drivers.samples import Channel, Quality, State

FEET: tuple[Foot, ...] = ("left", "right")


class Insole:
    """An insole on a serial port (a `Component`).

    Channels: `force` (N), `cop_x` and `cop_y` (m; foot frame: origin at the heel, x forward, y left; null
    below the force threshold), `cell_0` … (Pa).

    Raises:
        SettingsError: the layout does not exist or is wrong.

    """

    kind = Kind.INSOLE

    def __init__(self, name: str, settings: InsoleSettings, line: Line[InsoleFrame] | None = None) -> None:
        self.name = name
        self.settings = settings
        self.foot: Foot | None = settings.foot or _foot_in(name)
        self.line = line if line is not None else line_for(settings)
        layout = layouts.load(settings.layout)
        self.layout = layout if self.foot is None else layout.for_foot(self.foot)
        self.channels = _channels(name, len(self.layout.cells))
        self.latest = Latest(name, self.channels, settings.stale_after_s)
        self._indices = tuple(range(len(self.channels)))
        self._freshness = Freshness(settings.stale_after_s, settings.lost_after_s)
        self._fault: str | None = None  # what the device's own frames say is wrong
        self._other_feet = 0  # frames of the other foot since the last of ours

    def start(self) -> None:
        self._freshness.reset()
        self.latest.clear()
        self._fault, self._other_feet = None, 0
        self.line.start(self)

    def stop(self) -> None:
        self.line.stop(self)
        self.disconnected()

    def quality(self, now_ns: int) -> Quality:
        state, age_ms = self._freshness.state(now_ns)
        problem = self._fault
        if state is State.OK and problem is not None:
            state = State.FAULT
        elif state is not State.OK:
            problem = self.line.problem(now_ns) or problem or self._wrong_foot()
        return Quality(state, age_ms, problem, self._counters())

    def received(self, frame: InsoleFrame, stamp_ns: int) -> None:
        """A frame of the line; called in the port's thread."""
        if frame.late:
            return
        if self.foot is not None and frame.foot is not None and frame.foot != self.foot:
            self._other_feet += 1
            return
        self._other_feet = 0
        self._fault = self._fault_in(frame)
        self._freshness.seen(stamp_ns)
        pressures = self._pressures(frame)
        load = load_of(pressures, self.layout, self.settings.force_threshold)
        self.latest.update(stamp_ns, self._indices, (*load, *pressures))

    def disconnected(self) -> None:
        """The port went away: nothing that it said before is true any more."""
        self.latest.clear()
        self._freshness.disconnected()

    def _pressures(self, frame: InsoleFrame) -> tuple[float | None, ...]:
        count = len(self.layout.cells)
        if not frame.calibrated or len(frame.cells) != count:
            return (None,) * count
        return frame.cells

    def _fault_in(self, frame: InsoleFrame) -> str | None:
        if len(frame.cells) != len(self.layout.cells):
            return (
                f"{self.name} sends {len(frame.cells)} cells and the layout {self.layout.name} has "
                f"{len(self.layout.cells)}: correct `layout` in [insole.{self.name}]"
            )
        if not frame.calibrated:
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
        if not self._other_feet:
            return None
        other = FEET[self.foot == "left"]
        return (
            f"{self.line.path} sends frames of the {other} foot only: the two insoles' ports are swapped, "
            f"or [insole.{self.name}] needs foot = {other!r}"
        )

    def _counters(self) -> Mapping[str, int]:
        return {
            **self.line.parser.counters.as_dict(),
            "stale": self._freshness.stale,
            "reconnects": self.line.reconnects,
        }


def line_for(settings: InsoleSettings) -> Line[InsoleFrame]:
    """The line that `settings` describe."""
    return Line(settings.port, settings.baudrate, settings.format, FORMATS[settings.format])


def insoles(settings: Mapping[str, InsoleSettings]) -> list[Insole]:
    """The insoles of a robot; those that name the same port share its line.

    Raises:
        SettingsError: a layout is wrong.

    """
    lines: dict[str, Line[InsoleFrame]] = {}
    return [Insole(name, one, lines.setdefault(one.port, line_for(one))) for name, one in settings.items()]


def _foot_in(name: str) -> Foot | None:
    return next((foot for foot in FEET if name.startswith(foot)), None)


def _channels(name: str, cells: int) -> tuple[Channel, ...]:
    units = {"force": "N", "cop_x": "m", "cop_y": "m"} | {f"cell_{cell}": "Pa" for cell in range(cells)}
    return tuple(Channel(f"{name}.{quantity}", name, quantity, unit) for quantity, unit in units.items())
