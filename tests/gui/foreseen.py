"""What models would say of a robot, without any."""

from collections.abc import Mapping
from datetime import UTC, datetime, timedelta

from ml.registry.card import Card, DataSource
from ml.serving.predictor import Prediction
from ml.serving.trust import Trust
from server_gui.core.prediction.news import Predicted

TRUSTED = Trust(decisions=600)


def predicted(
    label: str,
    probabilities: Mapping[str, float],
    task: str = "activity",
    *,
    novelty: float = 0.1,
    trust: Trust = TRUSTED,
    values: Mapping[str, float] | None = None,
    source: DataSource = DataSource.SIMULATED,
) -> Predicted:
    """A model, three days old, that says this of exo-01 now."""
    prediction = Prediction(
        task, f"{task}-3fa2c1", 0, label, max(probabilities.values()), novelty, probabilities, values or {}
    )
    card = Card(
        id=f"{task}-3fa2c1",
        task=task,
        recipe=f"{task}/all",
        classes=tuple(probabilities),
        channels=(),
        units={},
        features_hash="",
        source=source,
        seed=0,
        made=datetime.now(UTC) - timedelta(days=3, hours=1),
        versions={},
    )
    return Predicted("exo-01", prediction, card, trust, 0, 12_000_000)
