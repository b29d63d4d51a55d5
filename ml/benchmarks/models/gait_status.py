"""Standing, walking, turning: boosted trees and small neural networks, which err in different places."""

from dataclasses import dataclass

from sklearn.ensemble import HistGradientBoostingClassifier, VotingClassifier
from sklearn.neural_network import MLPClassifier

from ml.neural import scaled


@dataclass(frozen=True, slots=True)
class StatusSettings:
    """Tuned settings."""

    learning_rate: float = 0.12
    rounds: int = 50
    leaves: int = 15
    penalty: float = 1.0
    epochs: int = 12
    networks: int = 4  # of other seeds: of a person unlike the others one alone is right by luck
    turn_weight: float = 2.0  # of a turn's probability: they are rare, and count as much in a macro-F1


def status_model(settings: StatusSettings | None = None) -> VotingClassifier:
    """Features of `GAIT_CONTEXT` → class; the trees' probability counts as much as all networks' together."""
    tuned = settings or StatusSettings()
    trees = HistGradientBoostingClassifier(
        learning_rate=tuned.learning_rate,
        max_iter=tuned.rounds,
        max_leaf_nodes=tuned.leaves,
        min_samples_leaf=40,
        l2_regularization=1.0,
        max_features=0.3,  # of the columns a split looks at: as good, and trees that differ
        max_bins=63,
        early_stopping=False,
        random_state=0,
    )
    networks = [
        MLPClassifier(
            hidden_layer_sizes=(64,),
            alpha=tuned.penalty,
            batch_size=128,
            max_iter=tuned.epochs,
            random_state=seed,
        )
        for seed in range(tuned.networks)
    ]
    return VotingClassifier(
        [("trees", trees), *((f"network_{seed}", scaled(one)) for seed, one in enumerate(networks))],
        voting="soft",
        weights=[len(networks), *(1 for _ in networks)],
    )
