"""Standing, walking, turning: boosted trees and a small neural network, which err in different places."""

from dataclasses import dataclass

from sklearn.ensemble import HistGradientBoostingClassifier, VotingClassifier
from sklearn.neural_network import MLPClassifier

from ml.neural import scaled


@dataclass(frozen=True, slots=True)
class StatusSettings:
    """What was tuned."""

    learning_rate: float = 0.12
    rounds: int = 50
    leaves: int = 15
    penalty: float = 1.0
    epochs: int = 12
    turn_weight: float = 2.0  # of a turn's probability: they are rare, and count as much in a macro-F1


def status_model(settings: StatusSettings | None = None) -> VotingClassifier:
    """Features of `GAIT_STATUS` → class; the mean of both probabilities decides."""
    tuned = settings or StatusSettings()
    trees = HistGradientBoostingClassifier(
        learning_rate=tuned.learning_rate,
        max_iter=tuned.rounds,
        max_leaf_nodes=tuned.leaves,
        min_samples_leaf=40,
        l2_regularization=1.0,
        max_features=0.3,  # of the columns a split looks at: as good, and trees that differ
        early_stopping=False,
        random_state=0,
    )
    network = MLPClassifier(
        hidden_layer_sizes=(64,), alpha=tuned.penalty, batch_size=128, max_iter=tuned.epochs, random_state=0
    )
    return VotingClassifier(
        [("trees", trees), ("network", scaled(network))],
        voting="soft",
    )
