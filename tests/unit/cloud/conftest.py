"""What the tests of the store's commands share."""

import pytest

from tests.unit.cloud import damages
from tests.unit.cloud.damages import Place
from tests.unit.cloud.filled import Filled


@pytest.fixture(scope="session")
def filled(store_libraries: None, tmp_path_factory: pytest.TempPathFactory) -> Filled:
    return Filled(tmp_path_factory.mktemp("filled"), damages.fill)


@pytest.fixture(scope="session")
def worn(store_libraries: None, tmp_path_factory: pytest.TempPathFactory) -> Filled:
    from tests.unit.cloud import test_forget

    return Filled(tmp_path_factory.mktemp("worn"), test_forget.fill)


@pytest.fixture
def place(filled: Filled, capsys: pytest.CaptureFixture[str]) -> Place:
    return Place(filled.anew(), capsys)
