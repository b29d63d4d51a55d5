"""Split of sessions into training and judging, and the choice of sensors and classes."""

import hashlib
from collections.abc import Iterable, Mapping, Sequence, Set
from typing import Final

from ml.errors import UnusableData
from ml.features.recipe import Recipe
from ml.robot.learn import LEAST_ROWS
from ml.robot.task import Task
from ml.store.labels import person
from ml.training.dataset import SessionDecisions

HELD_OUT_SHARE: Final = 0.25  # of wearers, or sessions, where nobody says which


def recipe_for(task: Task, channels: Sequence[Set[str]]) -> Recipe:
    """Return the richest recipe whose `channels` at least half of the sessions have.

    Raises:
        UnusableData: no session has enough.

    """
    offered = {recipe.name: recipe for there in channels if (recipe := task.recipe(there))}
    if not offered:
        raise UnusableData(
            f"no session has the channels that {task.name} takes (see gwrms docs explanation/prediction)"
        )
    having = {
        name: sum(there >= set(recipe.channels) for there in channels) for name, recipe in offered.items()
    }
    most = max(having.values())
    enough = [offered[name] for name, count in having.items() if count >= min(most, len(channels) / 2)]
    return max(enough, key=lambda recipe: (len(recipe.channels), recipe.name))


def judging(parts: Sequence[SessionDecisions]) -> list[SessionDecisions]:
    """Return those that may judge: one without a wearer's name may be of any wearer that has one."""
    return [each for each in parts if each.named] or list(parts)


def held_out(groups: Iterable[str], wanted: Sequence[str] = (), others: int = 0) -> frozenset[str]:
    """Return the judging wearers or sessions: as requested, else a quarter by a hash of their names.

    So somebody who is held out once stays so, however much is recorded later. `others` are sessions that
    only teach.

    Raises:
        UnusableData: one that is wanted is not there, or too few are left.

    """
    known = sorted(set(groups))
    if wanted:
        chosen = frozenset(_known(name, known, others) for name in wanted)
    else:
        places = {name: _place(name) for name in known}
        chosen = frozenset(name for name, place in places.items() if place < HELD_OUT_SHARE)
        chosen = chosen or frozenset(sorted(known, key=_place)[:1])
        while len(known) - len(chosen) + others < 2 and len(chosen) > 1:
            chosen -= {max(chosen, key=_place)}
    if not chosen or len(known) - len(chosen) + others < 2:
        raise UnusableData(
            f"wearers or sessions with labels: {', '.join(known) or 'none'}; "
            f"it takes two to learn from and one to judge by: {_remedy(len(known) + others)}"
        )
    return chosen


def _remedy(there: int) -> str:
    if there > 2:
        return "hold out fewer, or name whose the others are (gwrms label SESSION --wearer NAME)"
    return (
        "record more people, label what they do (gwrms label SESSION LABEL --from T --to T) "
        "and say who they are (gwrms label SESSION --wearer NAME)"
    )


def _known(name: str, known: Sequence[str], others: int) -> str:
    """Return the known person of this spelling."""
    for each in (name, person(name)):
        if each in known:
            return each
    hint = f" (and {others} sessions that do not say whose: gwrms label SESSION --wearer NAME)"
    raise UnusableData(f"nobody is called {name!r}; there are {', '.join(known)}{hint if others else ''}")


def _place(name: str) -> float:
    """Return a place from 0 to 1, the same for ever."""
    return int.from_bytes(hashlib.sha256(name.encode()).digest()[:8]) / 2**64


def too_few(examples: Mapping[str, int]) -> dict[str, str]:
    """Return the classes that are left out, of so many examples to learn from, and what is said of each."""
    return {
        name: f"{name} is left out: {count} examples; it takes {LEAST_ROWS}"
        for name, count in sorted(examples.items())
        if count < LEAST_ROWS
    }


def split(
    parts: Iterable[SessionDecisions], held: Set[str]
) -> tuple[list[SessionDecisions], list[SessionDecisions], list[SessionDecisions]]:
    """Parts to learn from, held out, and of the regression set."""
    every = list(parts)
    usual = [each for each in every if not each.regression]
    named = any(each.named and each.group in held for each in usual)
    judges = [each for each in usual if each.group in held and (each.named or not named)]
    chosen = set(map(id, judges))
    return (
        [each for each in usual if id(each) not in chosen],
        judges,
        [each for each in every if each.regression],
    )
