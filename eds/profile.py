"""Knowledge about a product beyond its EDS: the maker's own objects, and deviations from the standard.

One TOML file a product or family in `profiles/`, each entry with the document that it is taken from. A
profile is never needed: what has none is read by its EDS and CiA 402 alone. An entry counts only where the
device's EDS has that object with that type.
"""

import functools
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from eds.datatypes import DATA_TYPES
from eds.description import Description

FOLDER = Path(__file__).parent / "profiles"
QUANTITIES = ("temperature", "voltage", "brake")  # of a joint, which CiA 402 does not have or not everybody


@dataclass(frozen=True, slots=True)
class ProfileObject:
    """One object of the maker's own; value = number · scale, in `unit`."""

    index: int
    subindex: int
    type: str
    source: str
    unit: str = ""
    scale: float = 1.0

    @property
    def name(self) -> str:
        return f"{self.index:04X}h:{self.subindex}"

    def is_in(self, description: Description) -> bool:
        """Return whether the file has it as it should be."""
        variable = description.variable(self.index, self.subindex)
        known = None if variable is None else DATA_TYPES.get(variable.data_type or 0)
        return known is not None and known.name == self.type


@dataclass(frozen=True, slots=True)
class Quirk:
    """A product's deviation from the standard, and its consequence."""

    text: str
    source: str


@dataclass(frozen=True, slots=True)
class Profile:
    """A product, or a family of them that its maker gives the same objects."""

    name: str
    vendor_id: int
    products: tuple[int, ...]  # product codes; none: every product of the vendor that has the `mark`
    mark: ProfileObject | None
    quantities: Mapping[str, ProfileObject]
    gains: Mapping[str, ProfileObject]
    rated_torque_nm: float  # of one count of 6076h
    quirks: tuple[Quirk, ...]
    sources: tuple[str, ...]
    eds: str | None  # the file of such a product that ships

    def fits(self, description: Description) -> bool:
        """Return whether it is for the device of this file (1018h, CiA 301 §7.5.2.19)."""
        if description.vendor_id is None or description.vendor_id != self.vendor_id:
            return False
        if self.products:
            return description.product_code in self.products
        return self.mark is not None and self.mark.is_in(description)

    def found(self, description: Description) -> tuple[Mapping[str, ProfileObject], ...]:
        """Return its quantities and its gains, as far as this device has them."""
        both = (self.quantities, self.gains)
        return tuple({name: one for name, one in some.items() if one.is_in(description)} for some in both)


def profile_of(description: Description) -> Profile | None:
    """Return the profile for a device, `None` where nobody has written one."""
    fitting = [one for one in profiles() if one.fits(description)]
    return next((one for one in fitting if one.products), fitting[0] if fitting else None)


@functools.cache
def profiles() -> tuple[Profile, ...]:
    """Return all that ship, by their files' names."""
    return tuple(_read(path) for path in sorted(FOLDER.glob("*.toml")))


def _read(path: Path) -> Profile:
    table = tomllib.loads(path.read_text(encoding="utf-8"))
    rated = table.get("rated_torque", {"scale": 0.001})
    mark = table.get("mark")
    objects = {
        part: {name: _object(one) for name, one in table.get(part, {}).items()}
        for part in ("quantity", "gain")
    }
    quirks = tuple(Quirk(one["text"], one["source"]) for one in table.get("quirk", ()))
    cited = [one.source for some in objects.values() for one in some.values()]
    cited += [one.source for one in quirks] + ([rated["source"]] if "source" in rated else [])
    return Profile(
        name=table["name"],
        vendor_id=table["vendor_id"],
        products=tuple(table.get("products", ())),
        mark=None if mark is None else _object({"source": "", **mark}),
        quantities=objects["quantity"],
        gains=objects["gain"],
        rated_torque_nm=rated["scale"],
        quirks=quirks,
        sources=tuple(dict.fromkeys(cited)),
        eds=table.get("eds"),
    )


def _object(table: Mapping[str, Any]) -> ProfileObject:
    index, _, subindex = table["object"].partition(":")
    rest = {key: table[key] for key in ("unit", "scale") if key in table}
    return ProfileObject(int(index, 16), int(subindex), table["type"], table["source"], **rest)
