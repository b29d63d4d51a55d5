"""The signals that explain an alarm: its own first, then what its drive did, or the sensor's others."""

from collections.abc import Iterator, Sequence
from typing import Final

from gateway.wire.component import ChannelInfo
from gateway.wire.robot import Description

PLOTS: Final = 4  # units that are shown: more have no room in one look
_OF_DRIVE: Final = ("current", "torque", "position", "target_position", "velocity", "temperature", "voltage")


def explaining_signals(description: Description | None, channel: str) -> list[str]:
    """Return curves of the component that `channel` is of, that one first, in at most `PLOTS` units.

    Only of channels that the robot has. A drive's target that is no channel is computed of its position and
    following error, as target − position = following error (60F4h).
    """
    infos = () if description is None else description.channels
    own = next((info for info in infos if info.name == channel), None)
    if description is None or own is None:
        return [channel]
    of_it = [info for info in infos if info.component == own.component and not info.enum]
    is_drive = any(part.name == own.component and part.kind == "joint" for part in description.components)
    others = _of_drive(of_it) if is_drive else of_it
    found, units = [channel], [own.unit]
    for info in others:
        if info.unit not in units and len(units) < PLOTS:
            units.append(info.unit)
        if info.unit in units and info.name not in found:
            found.append(info.name)
    return [*found, *(_target(own.component, found, of_it) if is_drive else ())]


def _of_drive(infos: Sequence[ChannelInfo]) -> list[ChannelInfo]:
    """Return the channels that say what a drive did, the most telling first."""
    told = [info for info in infos if info.quantity in _OF_DRIVE]
    return sorted(told, key=lambda info: _OF_DRIVE.index(info.quantity))


def _target(joint: str, shown: Sequence[str], infos: Sequence[ChannelInfo]) -> Iterator[str]:
    """Yield the target as an expression, where the position is shown and no channel has it."""
    having = {info.quantity for info in infos}
    if f"{joint}.position" in shown and "target_position" not in having and "following_error" in having:
        yield f"target = {joint}.position + {joint}.following_error"
