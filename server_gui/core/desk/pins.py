"""Parameters that somebody wants at hand, per robot."""

from collections.abc import Mapping


class Pins:
    """Names by robot, kept from one window to the next."""

    def __init__(self) -> None:
        self._by_robot: dict[str, set[str]] = {}

    def of(self, robot: str) -> frozenset[str]:
        """Return what is pinned of this robot."""
        return frozenset(self._by_robot.get(robot, ()))

    def toggle(self, robot: str, name: str) -> None:
        """Pin a parameter, or no more."""
        self._by_robot.setdefault(robot, set()).symmetric_difference_update({name})

    def take(self, kept: object) -> None:
        """Load the kept pins; invalid ones are left out."""
        for robot, names in kept.items() if isinstance(kept, Mapping) else ():
            if isinstance(names, list):
                self._by_robot[str(robot)] = {str(name) for name in names}

    def to_keep(self) -> dict[str, list[str]]:
        """Return the pins to keep for the next time."""
        return {robot: sorted(names) for robot, names in self._by_robot.items() if names}
