"""Format `brilliant-star`: what the boards of Brilliant-Star-ch/Insole-Pressure-Sensor log (firmware 3.1).

A line a scan of both feet, 20 a second, 115200 baud, under a header that names its columns:
`time_ms,frame_id,R_ch0,…,R_ch15,L_ch0,…,L_ch15,flags`. (https://github.com/Brilliant-Star-ch/
Insole-Pressure-Sensor: what its firmware writes, and the logs beside it.)

- The converter is inverted: 4095 is an unloaded cell. The cells given here are 4095 less what is sent.
- The other foot's cells come by radio. A scan that waits for them, up to 70 ms, is written behind the next.
- What never came is sixteen zeros, which would be the highest load of all: that foot is missing. Bit 0 of
  `flags` says so of the left one; bit 1 only says that the board has waited.
"""

from msgspec.structs import replace

from drivers.clock import ClockSpec
from drivers.insole.description import CsvDescription, Flag
from drivers.insole.format import Format
from drivers.insole.formats.insole_csv import Columns, InsoleCsvParser
from drivers.insole.frame import InsoleFrame
from drivers.insole.layout import Layout

BITS = 12
UNLOADED = (1 << BITS) - 1
CHANNELS = 16
CHANNEL_NAMES = tuple(f"{foot}_ch{channel}" for foot in "RL" for channel in range(CHANNELS))
COLUMNS = ("time_ms", "frame_id", *CHANNEL_NAMES, "flags")
HEADER = ",".join(COLUMNS).encode("ascii")
DESCRIPTION = CsvDescription(
    columns=COLUMNS,
    time="time_ms",
    time_unit="ms",
    sequence="frame_id",
    flags=(Flag(source="flags", means="left_missing", mask=1),),
)
HIGHEST_FLAGS = 3
MILLIS_WRAP_US = (1 << 32) * 1000

# Rows from the toes to the heel, each from the inner to the outer side; foot frame and size as of insole-16.
LAYOUT = Layout(
    name="brilliant-star",
    foot="left",
    cells=(
        (0.232, -0.022, 0.00085),  # 0  great toe
        (0.224, 0.008, 0.00085),  # 1  other toes
        (0.193, -0.030, 0.00090),  # 2  before the metatarsal heads
        (0.193, -0.004, 0.00090),  # 3
        (0.186, 0.022, 0.00090),  # 4
        (0.162, -0.030, 0.00090),  # 5  metatarsal heads
        (0.162, -0.002, 0.00090),  # 6
        (0.158, 0.028, 0.00090),  # 7
        (0.126, -0.024, 0.00090),  # 8  midfoot, front
        (0.126, 0.000, 0.00090),  # 9
        (0.126, 0.025, 0.00090),  # 10
        (0.090, -0.020, 0.00090),  # 11 midfoot, rear
        (0.090, 0.001, 0.00090),  # 12
        (0.090, 0.021, 0.00090),  # 13
        (0.042, -0.016, 0.00110),  # 14 heel
        (0.042, 0.016, 0.00110),  # 15
    ),
)


class BrilliantStarParser(InsoleCsvParser):
    """Parser of `brilliant-star`; under another header nothing is a scan."""

    longest = 512

    def __init__(self) -> None:
        super().__init__(DESCRIPTION)
        self._foreign = False

    def _restart(self) -> None:
        super()._restart()
        self._foreign = False

    def _decode(self, raw: bytes) -> list[InsoleFrame] | None:
        line = raw.rstrip(b"\r")
        if line[:1].isalpha() and line.count(b",") == HEADER.count(b","):
            self._foreign = not HEADER.endswith(line)  # the stream may begin in it
            return None if self._foreign else []
        if line.startswith(b"["):  # what the board says when it starts
            return []
        return None if self._foreign else super()._decode(raw)

    def _frames(self, row: list[str], columns: Columns) -> list[InsoleFrame] | None:
        if len(row) != len(COLUMNS) or not all(map(_is_count, row)) or int(row[-1]) > HIGHEST_FLAGS:
            return None
        feet = super()._frames(row, columns) or []
        return [_as_load(foot) for foot in feet] if all(map(_in_range, feet)) else None


def _is_count(text: str) -> bool:
    return text.isascii() and text.isdecimal()


def _in_range(foot: InsoleFrame) -> bool:
    return all(cell is None or cell <= UNLOADED for cell in foot.cells)


def _as_load(foot: InsoleFrame) -> InsoleFrame:
    """Return counts that rise with the load, and none of a foot that did not come."""
    if foot.missing or not any(foot.cells):
        return replace(foot, cells=(None,) * len(foot.cells), missing=True, bits=BITS)
    return replace(foot, cells=tuple(UNLOADED - (cell or 0) for cell in foot.cells), bits=BITS)


FORMAT = Format(
    parser=lambda _: BrilliantStarParser, clock=ClockSpec(1_000_000, MILLIS_WRAP_US), layout=LAYOUT
)
