"""The drivers on real SocketCAN, in a Linux of its own where this machine's kernel has no CAN."""

import shutil
import subprocess
from pathlib import Path

import pytest

from drivers.bus.interfaces.netlink import read_link

SCRIPT = Path(__file__).with_name("uml")
BOOTED = "uml: booted"

missing = [command for command in ("linux.uml", "ip", "busybox") if shutil.which(command) is None]


@pytest.mark.skipif(read_link("vcan0") is not None, reason="vcan0 is here: the tests run on it directly")
@pytest.mark.skipif(
    bool(missing), reason=f"no {', '.join(missing)}: apt-get install user-mode-linux iproute2 busybox"
)
@pytest.mark.timeout(600)
def test_the_vcan_tests_pass_in_user_mode_linux() -> None:
    run = subprocess.run([SCRIPT], capture_output=True, text=True, timeout=580, check=False)
    if BOOTED not in run.stdout:
        pytest.skip(f"User Mode Linux does not boot here: {(run.stdout + run.stderr)[-300:]}")
    assert run.returncode == 0, run.stdout
