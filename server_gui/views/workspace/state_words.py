"""In words, which time signals show: live, paused, or what a trigger has kept; and what is not drawn."""

from collections.abc import Sequence
from typing import Final

from server_gui.core.desk.station import Station
from server_gui.core.workspace.scene import Scene
from server_gui.core.workspace.workspace import MOST_CURVES
from server_gui.views.marks import old_text
from server_gui.views.workspace.jump import Jump

GONE: Final = "Gone from here, see Recordings; this is live"


def state_words(
    scene: Scene, station: Station, chosen: Sequence[str], jump: Jump | None, *, is_gone: bool
) -> str:
    """Return them; `is_gone`: the instant that was asked for last is."""
    more = len([name for name in chosen if name not in scene.workspace.curves])
    many = f" · {more} more are not drawn: {MOST_CURVES} at a time" if more > 0 else ""
    comes = station.is_live or station.robot.is_recording
    if scene.frozen is None and is_gone:
        return GONE
    if scene.frozen is None:
        return f"{f'{station.robot.rate_hz():.0f} rows/s' if comes else old_text(station)[0]}{many}"
    stands = "Kept by the trigger" if scene.is_kept else "Paused"
    if not comes:
        return f"{stands} · {old_text(station)[0]}{many}"
    if jump is not None and jump.comes:
        return f"{stands}, up to {jump.around_s:.0f} s more come{many}"
    return f"{stands}{'' if station.robot.is_recording else ', data continue'}{many}"
