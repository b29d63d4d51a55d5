"""The insoles that the tables `[insole.NAME]` of the robot's file mean, and what they know of each other."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import cast

from drivers.build_context import BuildContext
from drivers.component import Component, ComponentKind
from drivers.insole.device import Insole, layout_of, line_for
from drivers.insole.settings import InsoleSettings


def build_insole(name: str, settings: InsoleSettings, site: BuildContext) -> Insole:
    """One foot; those that name the same port share its line.

    Raises:
        SettingsError: the layout or calibration is wrong.

    """
    if settings.port not in site.lines:
        layout = layout_of(settings.format, settings.layout, site.folder)
        site.lines[settings.port] = line_for(settings, layout, site.recognise, site.standstill)
    return Insole(name, settings, site.lines[settings.port], site.folder)


def join_insoles(components: Mapping[str, Component]) -> None:
    """Let the feet among `components` know each other, and each the hip of its leg."""
    feet = [cast("Insole", one) for one in components.values() if one.kind is ComponentKind.INSOLE]
    pair(feet)
    for foot in feet:
        if (hip := components.get(f"{foot.foot}_hip")) is not None:
            foot.follow_hip(hip.latest)


def pair(insoles: Sequence[Insole]) -> None:
    """Let the two feet of one wearer know each other, so that each can say its share of the load."""
    by_foot = {insole.foot: insole for insole in insoles}
    if len(insoles) == 2 and {"left", "right"} == set(by_foot):
        by_foot["left"].other, by_foot["right"].other = by_foot["right"], by_foot["left"]


def insoles(settings: Mapping[str, InsoleSettings], folder: Path | None = None) -> list[Insole]:
    """Return those of a wearer, by their names.

    Raises:
        SettingsError: a layout or calibration is wrong.

    """
    site = BuildContext((folder or Path()) / "robot.toml")
    made = [build_insole(name, one, site) for name, one in settings.items()]
    pair(made)
    return made
