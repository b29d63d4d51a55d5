"""Amounts in words: so many of something, bytes, shares, ages; a dash where there is none."""

NONE = "–"


def counted(count: int, one: str, more: str = "") -> str:
    """Return a number of things, in words."""
    return f"{count} {one if count == 1 else more or f'{one}s'}"


def percent(value: float | None) -> str:
    """Return a share of one hundred."""
    return NONE if value is None else f"{value:.1f} %"


def size(count: float) -> str:
    """Bytes in the unit that fits."""
    for unit in ("B", "KiB", "MiB"):
        if count < 1024:
            return f"{count:.0f} {unit}" if unit == "B" else f"{count:.1f} {unit}"
        count /= 1024
    return f"{count:.2f} GiB"


def age(seconds: float | None) -> str:
    """Return an age in words."""
    if seconds is None:
        return NONE
    seconds = max(0.0, seconds)  # what came while it was asked for is new
    return f"{seconds * 1000:.0f} ms" if seconds < 10 else f"{seconds:.0f} s"
