"""What the tests of the store's commands share."""

from pathlib import Path

import pytest

from tests.unit.cloud.damages import Place


@pytest.fixture
def place(store_libraries: None, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Place:
    return Place(tmp_path, capsys)
