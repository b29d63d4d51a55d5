"""Names of models for people: what it predicts, when it was made, for whom; their ids are hashes."""

from collections import Counter
from collections.abc import Iterable, Mapping
from typing import Final

from ml.registry.card import Card, DataSource
from server_gui.core.prediction.adaptation import ADAPTED

EVERY: Final = "every robot"
TASKS: Final[Mapping[str, str]] = {"activity": "Activity", "gait_phase": "Gait phase", "falling": "Falling"}
SOURCES: Final = {
    DataSource.RECORDED: "from recordings",
    DataSource.SIMULATED: "from simulated wearers",
    DataSource.MIXED: "from recordings and simulated wearers",
}
ID_SHOWN: Final = 4  # digits of an id, where two models would have one name


def task_name(task: str) -> str:
    """Return the name of a task for people."""
    return TASKS.get(task, task.replace("_", " ").capitalize())


def model_name(card: Card, *, shipped: bool = False) -> str:
    """Return a model's name, in this computer's time."""
    made = f"{card.made.astimezone():%d %b %Y %H:%M}".lstrip("0")
    if shipped:
        return f"{task_name(card.task)}, came with GWRMS"
    return f"{task_name(card.task)} of {made}" + (f", for {card.robot}" if card.robot else "")


def model_names(cards: Iterable[Card], shipped: Iterable[str] = ()) -> dict[str, str]:
    """Return a name of each by its id; two that would have the same have a piece of their id, too."""
    among = frozenset(shipped)
    names = {card.id: model_name(card, shipped=card.id in among) for card in cards}
    counts = Counter(names.values())
    return {
        model: name if counts[name] == 1 else f"{name} ({model.rpartition('-')[2][:ID_SHOWN]})"
        for model, name in names.items()
    }


def told_name(model: str) -> str:
    """Return a name of a model of which only the id (`activity-3fa2c1…`) is known."""
    base, adapted, _ = model.partition(ADAPTED)
    task, _, digits = base.rpartition("-")
    own = ", learned from its wearer" if adapted else ""
    return f"model {digits[:ID_SHOWN]} of {task_name(task).lower()}{own}" if task else f"the model {model}"


def told_task(model: str) -> str:
    """Return the same without digits, which nobody can read: `the falling model`."""
    base, adapted, _ = model.partition(ADAPTED)
    task = base.rpartition("-")[0]
    own = ", learned from its wearer" if adapted else ""
    return f"the {task_name(task).lower()} model{own}" if task else "a model"


def class_name(name: str) -> str:
    """Return a class, as people read it."""
    return name.replace("_", " ")
