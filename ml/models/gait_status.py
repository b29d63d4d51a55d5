"""Standing, walking, turning: boosted trees."""

from dataclasses import dataclass

from sklearn.ensemble import HistGradientBoostingClassifier
from sklearn.pipeline import Pipeline, make_pipeline


@dataclass(frozen=True, slots=True)
class StatusSettings:
    """What was tuned."""

    learning_rate: float = 0.1
    rounds: int = 80
    leaves: int = 15


def status_model(settings: StatusSettings | None = None) -> Pipeline:
    """Features of `GAIT_STATUS` → class."""
    tuned = settings or StatusSettings()
    return make_pipeline(
        HistGradientBoostingClassifier(
            learning_rate=tuned.learning_rate,
            max_iter=tuned.rounds,
            max_leaf_nodes=tuned.leaves,
            min_samples_leaf=40,
            l2_regularization=1.0,
            max_features=0.3,  # of the columns a split looks at: as good, and trees that differ
            early_stopping=False,
            random_state=0,
        )
    )
