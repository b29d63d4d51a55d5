"""A second of every device's stream, as an unknown sensor sends it."""

import struct
from pathlib import Path

from tests.unit.imu import encode as imu
from tests.unit.insole.encode import Sender, eighteen_cell_frame

GRID_EXAMPLE = bytes.fromhex(
    "5a5ae00ad6773866b7013701000038010000380100003801000037010000390100003a0100003a0100003a0100003b01"
    "0000000080400000604100001c42ffff793dfffff9bd000000000000553d0000d3bc00e07e3fa5a5"
)


def streams() -> dict[str, bytes]:
    """Format name → bytes, each cut at both ends."""
    sender = Sender()
    numbers = range(60)
    whole = {
        "witmotion": [
            imu.witmotion(0x51, n, -n, 2048, 2500) + imu.witmotion(0x53, n, 2 * n, 3 * n, 0) for n in numbers
        ],
        "bno08x-rvc": [imu.bno08x_rvc(n, n, -n, n, 1, 2, 1000) for n in numbers],
        "xsens": [
            imu.mtdata2({0x1020: struct.pack(">H", n), 0x2030: struct.pack(">3f", n, 1, 2)}) for n in numbers
        ],
        "vectornav": [imu.vectornav_ascii(f"VNYPR,+{n:03d}.5,-001.0,+000.5") for n in numbers],
        "insole-cobs": [sender.frame([n + cell for cell in range(16)]) for n in numbers],
        "insole-frame": [eighteen_cell_frame(1 + n % 2, [n] * 18) for n in numbers],
        "insole-csv": [f"{n},{n + 1},{n + 2},{n + 3}\r\n".encode() for n in numbers],
    }
    return {name: b"".join(frames)[7:-5] for name, frames in whole.items()}


def capture(folder: Path, data: bytes) -> Path:
    """`data` in a file."""
    path = folder / "capture.bin"
    path.write_bytes(data)
    return path
