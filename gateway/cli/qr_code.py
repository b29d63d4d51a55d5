"""A QR code for the terminal (ISO/IEC 18004): byte mode, level L, versions 2 to 4, which need one block.

Two modules a letter, one above the other; light ones are drawn, because terminals are dark.
"""

from collections.abc import Callable, Iterator
from typing import Final

QUIET: Final = 4  # modules around it that stay light (§5.3.8)
_CAPACITY: Final = {
    2: (34, 10),
    3: (55, 15),
    4: (80, 20),
}  # version: codewords of data, of correction (table 9)
_LEVEL: Final = 0b01  # L (table 12)
_BYTES: Final = 0b0100  # the mode (table 2)
_PADDING: Final = (0xEC, 0x11)
_FIELD, _FORMAT, _FORMAT_MASK = 0x11D, 0x537, 0x5412  # the polynomials of §7.5.2 and annex C
_MASKS: Final[
    tuple[Callable[[int, int], int], ...]
] = (  # of row and column: dark where it gives 0 (table 10)
    lambda row, column: (row + column) % 2,
    lambda row, _column: row % 2,
    lambda _row, column: column % 3,
    lambda row, column: (row + column) % 3,
    lambda row, column: (row // 2 + column // 3) % 2,
    lambda row, column: row * column % 2 + row * column % 3,
    lambda row, column: (row * column % 2 + row * column % 3) % 2,
    lambda row, column: ((row + column) % 2 + row * column % 3) % 2,
)
_LIKE_A_FINDER: Final = ("10111010000", "00001011101")

Modules = list[list[bool]]  # rows; dark ones are true


class TooLong(Exception):
    """The text has no room in the largest code that is drawn."""


def modules(text: str, mask: int | None = None) -> Modules:
    """Return the code of a text, with the mask that disturbs least (§7.8.3).

    Raises:
        TooLong: the text has more than 78 bytes.

    """
    data = text.encode("utf-8")
    version = next((one for one, (room, _) in _CAPACITY.items() if len(data) + 2 <= room), None)
    if version is None:
        raise TooLong(f"{len(data)} bytes are too many for a code of version 4")
    codewords = _codewords(data, *_CAPACITY[version])
    masks = range(len(_MASKS)) if mask is None else (mask,)
    return min((_drawn(version, codewords, one) for one in masks), key=penalty)


def lines(text: str) -> list[str]:
    """Return the code of a text as it is printed; raises `TooLong`."""
    inner = modules(text)
    width = len(inner) + 2 * QUIET
    blank, side = [[False] * width] * QUIET, [False] * QUIET
    rows = [*blank, *([*side, *row, *side] for row in inner), *blank, [True] * width]
    pairs = zip(rows[::2], rows[1::2], strict=False)
    return [
        "".join(" ▄▀█"[2 * (not upper) + (not lower)] for upper, lower in zip(*pair, strict=True))
        for pair in pairs
    ]


def correction(data: bytes, count: int) -> bytes:
    """Reed-Solomon codewords over GF(256), as many as asked for (§7.5.2)."""
    generator, root = [1] + [0] * count, 1
    for degree in range(count):
        for at in range(degree + 1, 0, -1):
            generator[at] ^= _times(generator[at - 1], root)
        root = _times(root, 2)
    remainder = [0] * count
    for byte in data:
        factor = byte ^ remainder[0]
        remainder = [
            one ^ _times(of, factor) for one, of in zip([*remainder[1:], 0], generator[1:], strict=True)
        ]
    return bytes(remainder)


def format_bits(mask: int) -> int:
    """Level and mask with their 10 bits of correction (annex C)."""
    data = _LEVEL << 3 | mask
    rest = data << 10
    for bit in range(14, 9, -1):
        if rest >> bit & 1:
            rest ^= _FORMAT << bit - 10
    return (data << 10 | rest) ^ _FORMAT_MASK


def penalty(code: Modules) -> int:
    """Return the penalty of patterns that look like something else (§7.8.3.1)."""
    rows = ["".join("01"[module] for module in row) for row in code]
    rows += ["".join(column) for column in zip(*rows, strict=True)]
    runs = sum(map(_run_penalty, rows))
    finders = sum(
        40
        for row in rows
        for pattern in _LIKE_A_FINDER
        for at in range(len(row))
        if row.startswith(pattern, at)
    )
    size = range(len(code) - 1)
    blocks = sum(
        3 for y in size for x in size if code[y][x] == code[y][x + 1] == code[y + 1][x] == code[y + 1][x + 1]
    )
    dark_percent = 100 * sum(map(sum, code)) / len(code) ** 2
    return runs + finders + blocks + 10 * int(abs(dark_percent - 50) / 5)


def _run_penalty(row: str) -> int:
    runs = row.replace("01", "0 1").replace("10", "1 0").split()
    return sum(len(run) - 2 for run in runs if len(run) >= 5)


def _times(one: int, other: int) -> int:
    """In GF(256)."""
    product = 0
    for bit in range(7, -1, -1):
        product = product << 1 ^ (product >> 7) * _FIELD ^ (other >> bit & 1) * one
    return product


def _codewords(data: bytes, room: int, corrections: int) -> bytes:
    """Mode, length, the bytes themselves and an end, each of the first two not on a byte's edge; padded."""
    bits = f"{_BYTES:04b}{len(data):08b}" + "".join(f"{byte:08b}" for byte in data) + "0000"
    found = bytes(int(bits[at : at + 8], 2) for at in range(0, len(bits), 8))
    found += bytes(_PADDING[at % 2] for at in range(room - len(found)))
    return found + correction(found, corrections)


def _drawn(version: int, codewords: bytes, mask: int) -> Modules:
    size = 17 + 4 * version
    code = [[False] * size for _ in range(size)]
    fixed = [[False] * size for _ in range(size)]

    def fix(row: int, column: int, dark: bool) -> None:
        code[row][column], fixed[row][column] = dark, True

    for at in range(size):
        fix(6, at, at % 2 == 0)
        fix(at, 6, at % 2 == 0)
    for row, column, radius in ((3, 3, 4), (3, size - 4, 4), (size - 4, 3, 4), (size - 7, size - 7, 2)):
        for y in range(max(0, row - radius), min(size, row + radius + 1)):
            for x in range(max(0, column - radius), min(size, column + radius + 1)):
                ring = max(abs(y - row), abs(x - column))
                fix(y, x, ring % 2 == 0 if radius == 2 else ring not in (2, 4))
    for (row, column), bit in zip(_format_places(size), 2 * f"{format_bits(mask):015b}", strict=True):
        fix(row, column, bit == "1")
    fix(size - 8, 8, True)
    bits = "".join(f"{byte:08b}" for byte in codewords)
    free = [(row, column) for row, column in _path(size) if not fixed[row][column]]
    for (row, column), bit in zip(free, bits.ljust(len(free), "0"), strict=True):
        code[row][column] = (bit == "1") != (_MASKS[mask](row, column) == 0)
    return code


def _format_places(size: int) -> Iterator[tuple[int, int]]:
    """Yield the places of both copies, the highest bit first (figure 25)."""
    beside = (0, 1, 2, 3, 4, 5, 7, 8)
    yield from ((8, column) for column in beside)
    yield from ((row, 8) for row in reversed(beside[:-1]))
    yield from ((row, 8) for row in range(size - 1, size - 8, -1))
    yield from ((8, column) for column in range(size - 8, size))


def _path(size: int) -> Iterator[tuple[int, int]]:
    """From the right two columns at once, upwards and downwards in turn, past the timing's (§7.7.3)."""
    rights = [right for right in range(size - 1, 0, -1) if right % 2 == 0 and right > 6] + [5, 3, 1]
    for number, right in enumerate(rights):
        rows = range(size) if number % 2 else range(size - 1, -1, -1)
        yield from ((row, column) for row in rows for column in (right, right - 1))
