"""Controllers that are held, as after a lost joint: they move nothing until somebody starts them."""

from collections.abc import Iterator, Mapping

from gateway.wire.robot import Description

HELD = "held"  # the word of a controller that waits to be started


def holding_channels(robot: Description) -> list[str]:
    """Return the states of controllers, where one of them is `held`."""
    controllers = (one for one in robot.channels if one.component in robot.stop.controllers)
    return [one.name for one in controllers if one.enum and HELD in one.enum.values()]


def held_channels(robot: Description, values: Mapping[str, float | None]) -> Iterator[str]:
    """Yield those that are held now."""
    words = {one.name: one.enum for one in robot.channels if one.enum}
    for name in holding_channels(robot):
        value = values.get(name)
        if value is not None and words[name].get(f"{value:.0f}") == HELD:
            yield name
