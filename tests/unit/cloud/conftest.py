"""What the tests of the store's commands share."""

import shutil
from pathlib import Path

import pytest

from tests.unit.cloud.damages import Place, fill


@pytest.fixture(scope="session")
def filled(store_libraries: None, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Recorded once, because a copy takes a tenth of the time."""
    folder = tmp_path_factory.mktemp("filled")
    fill(folder / "now")
    shutil.copytree(folder / "now", folder / "first")
    return folder


@pytest.fixture
def place(filled: Path, capsys: pytest.CaptureFixture[str]) -> Place:
    """As it was recorded, and where: a spool knows the address of its store."""
    shutil.rmtree(filled / "now")
    shutil.copytree(filled / "first", filled / "now")
    return Place(filled / "now", capsys)
