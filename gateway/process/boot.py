"""The boot from which the monotonic clock counts."""

import functools
import uuid
from pathlib import Path


@functools.cache
def boot_id() -> str:
    """Return an id that changes when the monotonic clock restarts: the kernel's boot, else this process."""
    try:
        return Path("/proc/sys/kernel/random/boot_id").read_text(encoding="ascii").strip()
    except OSError:
        return str(uuid.uuid4())
