"""The binding of a curve's text to one robot: a channel, an expression over channels, or why neither."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Final

from gateway.units import Unit, Units
from gateway.wire.component import ChannelInfo
from server_gui.core.desk.station import Station
from server_gui.core.workspace.expressions import Program
from server_gui.core.workspace.grammar import ExpressionError, Written, parse

BESIDE: Final = "beside."  # before a channel: of the robot or recording that is beside this one

Channels = Mapping[str, ChannelInfo]


def channels_of(station: Station | None) -> list[ChannelInfo]:
    """Return those that a robot's components have."""
    description = None if station is None else station.robot.description
    return (
        [] if description is None else [info for info in description.channels if info.component != "resource"]
    )


@dataclass(frozen=True, slots=True)
class CurveBinding:
    """`problem` says why nothing is drawn; `written` is None for a plain channel; `unit` is the shown one."""

    text: str
    name: str
    unit: Unit | None = None
    written: Written | None = None
    needs: tuple[str, ...] = ()
    si: Mapping[str, str] | None = None  # units of what it needs
    problem: str = ""
    mark: str = ""  # the same in lines, with the place marked

    def program(self) -> Program:
        """Return a new program that computes it, from its first row."""
        if self.written is None:
            raise ValueError(f"{self.text} is a channel")
        return Program(self.written, self.text, self.si or {})


def meaning(text: str, channels: Channels, units: Units) -> CurveBinding:
    """Return the meaning of a curve's text, given these channels; never raises."""
    if text in channels:
        info = channels[text]
        return CurveBinding(text, text, units.unit(info.quantity, info.unit), needs=(text,))
    try:
        written = parse(text)
        missing = sorted(written.channels - channels.keys())
        if missing:
            return CurveBinding(text, written.name, problem=not_here(missing, is_told=bool(channels)))
        si = {name: channels[name].unit for name in written.channels}
        program = Program(written, text, si)
        shown = _shown(written, program.unit, channels, units)
        return CurveBinding(text, written.name, shown, written, program.channels, si)
    except ExpressionError as error:
        name = text.partition("=")[0].strip() or text
        return CurveBinding(text, name, problem=error.line, mark=str(error))


def _shown(written: Written, si: str, channels: Channels, units: Units) -> Unit:
    """Return the unit; a single channel keeps that of its quantity, whatever its name."""
    only = channels[written.tree.text] if written.tree.kind == "channel" else None
    return units.unit("" if only is None else only.quantity, si)


def not_here(names: Iterable[str], *, is_told: bool = True) -> str:
    """Return in words that these channels are missing."""
    beside = [name.removeprefix(BESIDE) for name in names if name.startswith(BESIDE)]
    here = [name for name in names if not name.startswith(BESIDE)]
    told = f"this robot has no {', '.join(here)}" if is_told else "this robot has not told what it has"
    said = [told] if here else []
    return "; ".join([*said, *([f"nothing beside it has {', '.join(beside)}"] if beside else [])])


def with_beside(here: Iterable[ChannelInfo], beside: Iterable[ChannelInfo]) -> dict[str, ChannelInfo]:
    """Return the channels of both by the names that they have in expressions."""
    return {info.name: info for info in here} | {f"{BESIDE}{info.name}": info for info in beside}
