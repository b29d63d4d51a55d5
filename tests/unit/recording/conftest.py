"""A spool of a test's own."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from server_gui.core.recording.spool import Spool


@pytest.fixture
def spool(tmp_path: Path) -> Iterator[Spool]:
    with Spool(tmp_path / "spool", reserve_bytes=0) as opened:
        yield opened
