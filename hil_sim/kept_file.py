"""A robot.toml that was there already, compared with the sensors that are simulated now."""

import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

_KINDS: Final = ("imu", "insole")
_KEYS: Final = ("format", "layout", "baudrate", "bus")  # those by which a gateway reads a sensor


def disagreements(kept: Path, fresh: str) -> list[str]:
    """Return in words what the kept file says of sensors otherwise than the one that would be written now.

    None of a file that cannot be read: whoever edited it hears of that from `gwrms check`.
    """
    try:
        there = tomllib.loads(kept.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return []
    return list(_differences(there, tomllib.loads(fresh)))


def _differences(there: dict[str, Any], ours: dict[str, Any]) -> Iterator[str]:
    for kind in _KINDS:
        tables: Any = there.get(kind)
        kept = tables if isinstance(tables, dict) else {}
        for name, simulated in ours.get(kind, {}).items():
            said = kept.get(name)
            if not isinstance(said, dict):
                yield f"the file has no [{kind}.{name}], and you simulate one"
                continue
            for key in _KEYS:
                if said.get(key) != simulated.get(key):
                    yield (
                        f"the file says {said.get(key, 'no')} for [{kind}.{name}] {key}, you simulate "
                        f"{simulated.get(key, 'none')}"
                    )
