"""Left and right foot."""

from typing import Literal

Foot = Literal["left", "right"]
FEET: tuple[Foot, ...] = ("left", "right")


def foot_in(name: str) -> Foot | None:
    """Return the foot that a component's name begins with."""
    return next((foot for foot in FEET if name.startswith(foot)), None)
