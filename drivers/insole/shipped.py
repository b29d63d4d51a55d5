"""The layouts that ship, by their names; what they say is read by `layout.py`."""

from pathlib import Path

SHIPPED = Path(__file__).parent / "layouts"


def shipped_names() -> list[str]:
    """In the order of the alphabet."""
    return sorted(file.stem for file in SHIPPED.glob("*.toml"))
