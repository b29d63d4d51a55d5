"""Bytes as received at another baud rate than they were sent at."""

_SAMPLES = 10  # of one character: start bit, eight data bits, stop bit, each in its middle


def heard_at(data: bytes, sent_baud: int, heard_baud: int) -> bytes:
    """Return `data`, sent without pauses as 8N1, as received at `heard_baud`.

    As a 16550 does: a falling edge begins a character, a start bit that is high in its middle is noise, and a
    character without a stop bit is passed on, its missing stop bit taken for the next start.
    """
    line = [bit for byte in data for bit in (0, *(byte >> place & 1 for place in range(8)), 1)]
    step = sent_baud / heard_baud
    heard, at = bytearray(), 0.0
    while (start := _next_low(line, at)) is not None:
        first, *bits, stop = (_level(line, start + (sample + 0.5) * step) for sample in range(_SAMPLES))
        if first:
            at = start + 0.5 * step
            continue
        heard.append(sum(bit << place for place, bit in enumerate(bits)))
        at = start + (_SAMPLES - 0.5 if stop else _SAMPLES - 1) * step
    return bytes(heard)


def _next_low(line: list[int], at: float) -> float | None:
    """Return when the line is low next, from `at` on; `None` if it stays idle."""
    if _level(line, at) == 0:
        return at
    try:
        return float(line.index(0, int(at) + 1))
    except ValueError:
        return None


def _level(line: list[int], at: float) -> int:
    return line[int(at)] if at < len(line) else 1
