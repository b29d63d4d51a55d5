"""Emergency messages: whatever eight bytes say, there are words for it."""

from drivers.bus.emcy import parse_emcy

TOKENS = (b"\x10\x23", b"\x11\x86", b"\0\0", b"\xff\xff")
MODULES = ("drivers.bus.emcy",)


def fuzz(data: bytes) -> None:
    emcy = parse_emcy(1, data[:8])
    assert (emcy is None) == (len(data) < 3)
    if emcy is not None:
        for vendor_id in (None, 0, 0xFB, 1 << 32):
            text = emcy.text(vendor_id)
            assert text.startswith(f"0x{emcy.code:04X} ")
            assert text.isprintable()
