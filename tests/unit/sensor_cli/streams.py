"""A second of every device's stream, as an unknown sensor sends it: `STREAM` of each format's own test."""

import importlib
from pathlib import Path

import pytest

from drivers.imu.formats import FORMATS as IMUS
from drivers.insole.formats import FORMATS as INSOLES

GRID_EXAMPLE = bytes.fromhex(
    "5a5ae00ad6773866b7013701000038010000380100003801000037010000390100003a0100003a0100003a0100003b01"
    "0000000080400000604100001c42ffff793dfffff9bd000000000000553d0000d3bc00e07e3fa5a5"
)


def streams() -> dict[str, bytes]:
    """Format name → bytes, each cut at both ends."""
    tests = dict.fromkeys(IMUS, "imu") | dict.fromkeys(INSOLES, "insole")
    return {name: stream_of(folder, name) for name, folder in tests.items()}


def stream_of(folder: str, name: str) -> bytes:
    """Return the stream of one format, from its own test in that folder."""
    test = f"test_{name.replace('-', '_')}"
    try:
        frames: list[bytes] = importlib.import_module(f"tests.unit.{folder}.{test}").STREAM
    except (ModuleNotFoundError, AttributeError) as error:
        how = {"imu": "docs/how-to/add-an-imu.md", "insole": "docs/how-to/add-an-insole.md"}[folder]
        raise pytest.UsageError(
            f"write tests/unit/{folder}/{test}.py with STREAM: {how} ({error})"
        ) from error
    return b"".join(frames)[7:-5]


def capture(folder: Path, data: bytes) -> Path:
    """`data` in a file."""
    path = folder / "capture.bin"
    path.write_bytes(data)
    return path
