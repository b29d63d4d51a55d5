"""The QR code of a robot's link: as another encoder makes it, and read again from what is printed."""

import hashlib
from collections.abc import Callable, Mapping
from typing import Final

import pytest

from gateway.cli import qr_code

MASKED: Final[Mapping[int, Callable[[int, int], int]]] = {
    0: lambda y, x: (y + x) % 2,
    1: lambda y, _x: y % 2,
    2: lambda _y, x: x % 3,
    3: lambda y, x: (y + x) % 3,
    4: lambda y, x: (y // 2 + x // 3) % 2,
    5: lambda y, x: (y * x) % 2 + (y * x) % 3,
    6: lambda y, x: ((y * x) % 2 + (y * x) % 3) % 2,
    7: lambda y, x: ((y + x) % 2 + (y * x) % 3) % 2,
}
LINK = "gwrms://192.0.2.7:7421/7K3F-9QWD-02MH-XTVA"
SHORT = "gwrms://1.2.3.4:7421/7K3F"
LONG = "gwrms://[fe80:1111:2222:3333:4444:5555:6666:7777]:7421/7K3F-9QWD-02MH-XTVA"


@pytest.mark.parametrize(
    ("text", "size", "digest"),
    [
        (SHORT, 25, "c5d2e4d09263efac832fb801b90c4092250c370a2caf6ff1c81fcad0e5d29c75"),
        (LINK, 29, "daec8dfc6b7338a5fc2b2ef29e569f5cab46bbf47cad0476fa40b423890a668c"),
        (LONG, 33, "ac26893704f1dd58e16ad17b3bd4b35af5ce86885dad681ac3d3a9b07094b1ee"),
    ],
)
def test_it_is_module_by_module_what_another_encoder_draws(text: str, size: int, digest: str) -> None:
    """Nayuki's QR Code generator, level L, with each of the eight masks and with the one that it chooses."""
    drawn = [qr_code.modules(text, mask) for mask in (*range(8), None)]
    assert {len(one) for one in drawn} == {size}
    bits = "".join("01"[module] for one in drawn for row in one for module in row)
    assert hashlib.sha256(bits.encode("ascii")).hexdigest() == digest


def test_correction_and_format_are_those_of_published_examples() -> None:
    data = bytes([32, 91, 11, 120, 209, 114, 220, 77, 67, 64, 236, 17, 236, 17, 236, 17])
    assert list(qr_code.correction(data, 10)) == [196, 35, 39, 119, 235, 215, 231, 226, 93, 23]
    assert [f"{qr_code.format_bits(mask):015b}" for mask in (0, 4, 7)] == [
        "111011111000100",
        "110011000101111",
        "110100101110110",
    ]


@pytest.mark.parametrize("text", [SHORT, LINK, LONG])
def test_what_is_printed_is_read_again(text: str) -> None:
    assert decoded(scanned(qr_code.lines(text))) == text


def test_it_fits_a_terminal_with_its_quiet_zone() -> None:
    lines = qr_code.lines(LONG)
    assert (len(lines[0]), len(lines)) == (41, 21)
    assert set(lines[0] + lines[1]) == {"█"}


def test_what_has_no_room_is_not_drawn() -> None:
    assert qr_code.modules("x" * 78)
    with pytest.raises(qr_code.TooLong):
        qr_code.modules("x" * 79)


def scanned(lines: list[str]) -> list[list[bool]]:
    """Dark modules of what a terminal shows: a light one is a drawn half."""
    rows = [[letter in light for letter in line] for line in lines for light in (" ▄", " ▀")]
    quiet = qr_code.QUIET
    return [row[quiet:-quiet] for row in rows[quiet : len(lines[0]) - quiet]]


def decoded(code: list[list[bool]]) -> str:
    """By the standard's reference algorithm (clause 11), where nothing is damaged."""
    size = len(code)
    mask = (code[8][2] << 2 | code[8][3] << 1 | code[8][4]) ^ 0b101
    masked = MASKED[mask]
    bits, upwards, column = "", True, size - 1
    while column > 0:
        column -= column == 6
        for y in range(size - 1, -1, -1) if upwards else range(size):
            for x in (column, column - 1):
                if not _is_function(y, x, size):
                    bits += "01"[code[y][x] != (masked(y, x) == 0)]
        upwards, column = not upwards, column - 2
    assert bits[:4] == "0100", "byte mode"
    length = int(bits[4:12], 2)
    return bytes(int(bits[at : at + 8], 2) for at in range(12, 12 + 8 * length, 8)).decode("utf-8")


def _is_function(y: int, x: int, size: int) -> bool:
    corner = (y <= 8 and x <= 8) or (y <= 8 and x >= size - 8) or (y >= size - 8 and x <= 8)
    alignment = abs(y - (size - 7)) <= 2 and abs(x - (size - 7)) <= 2
    return corner or alignment or y == 6 or x == 6
