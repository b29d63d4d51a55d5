"""Insoles that send text; the first byte says which description it is read by."""

from drivers.insole.description import CsvDescription, Flag
from drivers.insole.formats.insole_csv import InsoleCsvParser
from tests.fuzz.serial_streams import judge

TOKENS = (
    b"ch1,",
    b"ch2",
    b"L_ch1,",
    b"R_ch1,",
    b"time_ms,",
    b"seq,",
    b"foot,",
    b"\n",
    b"nan",
    b"1e308",
    b"-1",
    b"0x1",
)
MODULES = ("drivers.insole.formats.insole_csv", "drivers.parsing")
DESCRIPTIONS = (
    CsvDescription(),
    CsvDescription(
        columns=("t", "n", "foot", "ch1", "ch2"), time="t", time_unit="ms", sequence="n", foot="foot"
    ),
    CsvDescription(
        delimiter=";",
        cells=(2, 3),
        columns=("seq", "flags", "a", "b"),
        flags=(Flag(source="flags", means="saturated", mask=1), Flag(source=1, means="missing", equals="x")),
        pascal_per_count=10.0,
        sequence_modulus=256,
    ),
)


def fuzz(data: bytes) -> None:
    description = DESCRIPTIONS[data[0] % len(DESCRIPTIONS) if data else 0]
    judge(lambda: InsoleCsvParser(description), data[1:])
