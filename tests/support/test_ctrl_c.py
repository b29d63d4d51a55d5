"""Ctrl-C is heard by what tests start, also where the suite itself was started with `&`."""

import signal
import subprocess
import sys
from collections.abc import Iterator

import pytest

from tests.conftest import hear_ctrl_c


@pytest.fixture
def in_the_background() -> Iterator[None]:
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("in_the_background")
def test_a_process_of_a_test_hears_ctrl_c_though_the_suite_was_to_ignore_it() -> None:
    hear_ctrl_c()
    says = "import signal; print(signal.getsignal(signal.SIGINT) is signal.default_int_handler)"
    said = subprocess.run(
        [sys.executable, "-I", "-S", "-c", says], capture_output=True, check=True, text=True
    )
    assert said.stdout == "True\n"


def test_who_hears_it_already_keeps_its_own_way() -> None:
    def own(_number: int, _frame: object) -> None: ...

    before = signal.signal(signal.SIGINT, own)
    try:
        hear_ctrl_c()
        assert signal.getsignal(signal.SIGINT) is own
    finally:
        signal.signal(signal.SIGINT, before)
