"""Emergency messages (EMCY), taken apart and in words."""

from dataclasses import dataclass

from drivers.error_codes import error_text

_REGISTER_BITS = ("generic", "current", "voltage", "temperature", "communication", "profile", "", "vendor")


@dataclass(frozen=True, slots=True)
class Emcy:
    """One emergency message (CiA 301 §7.2.7)."""

    stamp_ns: int
    code: int
    register: int  # 1001h, bits by `_REGISTER_BITS`
    vendor_data: bytes

    @property
    def resets(self) -> bool:
        """Whether it says that the errors are over."""
        return self.code >> 8 == 0

    def text(self, vendor_id: int | None = None) -> str:
        """`0x8611 following error too large (register: generic, profile)`."""
        bits = [name for bit, name in enumerate(_REGISTER_BITS) if name and self.register >> bit & 1]
        register = f" (register: {', '.join(bits)})" if bits else ""
        return f"{error_text(self.code, vendor_id)}{register}"


def parse_emcy(stamp_ns: int, data: bytes) -> Emcy | None:
    """Return an EMCY frame; `None` for one that is too short."""
    if len(data) < 3:
        return None
    return Emcy(stamp_ns, int.from_bytes(data[:2], "little"), data[2], data[3:])
