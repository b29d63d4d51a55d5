"""What the tests of training share."""

from collections.abc import Iterator

import pytest

from ml.robot import learn, novelty


@pytest.fixture(scope="module")
def small_models() -> Iterator[None]:
    """The wearers made up here differ by far more than the robot's do."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(learn, "EPOCHS", 6)
        patch.setattr(learn, "FOLDS", 2)
        patch.setattr(novelty, "PROTOTYPES", 16)
        patch.setattr(novelty, "COMPONENTS", 8)
        yield
