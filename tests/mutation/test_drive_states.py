"""The tables that stop, reset and enable a drive, held against a state machine written from CiA 402-2.

Everything here is from the standard: it imports the product's tables only to judge them.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import pytest

from drivers.joint import cia402, commands
from drivers.joint.cia402 import DriveState
from drivers.joint.commands import Controlword
from tests.mutation.tables import Mutant, added_mutants, mapping_mutants, set_mutants, unnoticed
from tests.unit.joint.standard import LEAVES_BY_ITSELF, STATUSWORDS, S, after

BITS_OF_COMMANDS = 0x008F
# From the requirement: the words of a stop and of a reset, the states on the one way down and the one way up.
STOP, FALLBACK = 0x0002, 0x0000
DOWN = {
    S.OPERATION_ENABLED: (0x0002,),
    S.QUICK_STOP_ACTIVE: (0x0000,),
    S.SWITCHED_ON: (0x0000,),
    S.READY_TO_SWITCH_ON: (0x0000,),
    S.FAULT: (0x0000, 0x0080, 0x0000),
}
SHORTEST_DOWN = {
    S.OPERATION_ENABLED: [S.QUICK_STOP_ACTIVE, S.SWITCH_ON_DISABLED],
    S.QUICK_STOP_ACTIVE: [S.SWITCH_ON_DISABLED],
    S.SWITCHED_ON: [S.SWITCH_ON_DISABLED],
    S.READY_TO_SWITCH_ON: [S.SWITCH_ON_DISABLED],
    S.FAULT: [S.SWITCH_ON_DISABLED],
    S.SWITCH_ON_DISABLED: [],
}
UP = [S.SWITCH_ON_DISABLED, S.READY_TO_SWITCH_ON, S.SWITCHED_ON, S.OPERATION_ENABLED]


@dataclass(frozen=True)
class Tables:
    """What the product says; each is judged with the others as they are."""

    quick_stop: int = Controlword.QUICK_STOP
    disable_voltage: int = Controlword.DISABLE_VOLTAGE
    stopped: frozenset[DriveState] = commands.STOPPED_STATES
    down: Mapping[DriveState, tuple[int, ...]] = None  # type: ignore[assignment]
    up: Mapping[DriveState, tuple[int, DriveState]] = None  # type: ignore[assignment]


PRODUCT = Tables(down=dict(commands.WAY_DOWN), up=dict(commands.WAY_UP))


def complaints(tables: Tables) -> Iterator[str]:
    """Everything that is wrong with them; nothing where all is well."""
    yield from about_stopping(tables)
    yield from about_the_way_down(tables)
    yield from about_the_way_up(tables)


def about_stopping(tables: Tables) -> Iterator[str]:
    sent = {
        tables.quick_stop,
        tables.disable_voltage,
        *(word for way in tables.down.values() for word in way),
    }
    if (tables.quick_stop, tables.disable_voltage) != (STOP, FALLBACK):
        yield "a stop has other bits than those of its command"
    for word in sent:
        for state in S:
            for before in (0x00, 0x80):  # of the word before only bit 7 matters
                for stays in (False, True):
                    led = after(state, word, before, stays)
                    if led is S.OPERATION_ENABLED and state is not S.OPERATION_ENABLED:
                        yield f"0x{word:04X} enables a drive in {state.words}"
    for stays in (False, True):
        yield from _about_stopped(tables, stays)


def _about_stopped(tables: Tables, stays: bool) -> Iterator[str]:
    for state in S:
        braked = after(state, tables.quick_stop, 0x0F, stays)
        if state is S.OPERATION_ENABLED and braked is not S.QUICK_STOP_ACTIVE:
            yield "a quick stop does not brake an enabled drive"
        if after(state, tables.disable_voltage, 0x0F, stays) in (S.OPERATION_ENABLED, S.QUICK_STOP_ACTIVE):
            yield f"disable voltage leaves current in {state.words}"
        if braked not in LEAVES_BY_ITSELF and braked not in tables.stopped:
            yield f"a drive that a quick stop has led to {braked.words} would never count as stopped"
    reached = {after(state, tables.quick_stop, 0x0F, stays) for state in S} - LEAVES_BY_ITSELF
    for state in tables.stopped - reached:
        yield f"{state.words} counts as stopped, and no stop leads there"


def about_the_way_down(tables: Tables) -> Iterator[str]:
    if tables.down != DOWN:
        yield "it is not the way that is asked for"
    for origin in S:
        if origin in LEAVES_BY_ITSELF:
            continue
        for before in (0x00, 0x80):
            for stays in (False, True):
                way = list(_way_down(tables, origin, before, stays))
                if way != SHORTEST_DOWN[origin]:
                    yield f"from {origin.words} it goes {[state.words for state in way]}"


def _way_down(tables: Tables, state: DriveState, before: int, stays: bool) -> Iterator[DriveState]:
    """The states on the way, as the drive is led by the table alone."""
    for _ in range(4):
        words, origin = tables.down.get(state, ()), state
        for word in words:
            state, before = after(state, word, before, stays), word
        if words and before & 0x80:
            yield S.FAULT  # the next fault could not be reset: bit 7 would not rise
        if state is origin:
            return
        yield state


def about_the_way_up(tables: Tables) -> Iterator[str]:
    if [*tables.up, S.OPERATION_ENABLED] != UP:
        yield "it does not go through every state, one after the other"
        return
    for origin, (word, target) in tables.up.items():
        if target is not UP[UP.index(origin) + 1]:
            yield f"from {origin.words} it expects {target.words}"
        for stays in (False, True):
            led = after(origin, word, 0x00, stays)
            if led is not target:
                yield f"0x{word:04X} leads from {origin.words} to {led.words}"
        if word & ~BITS_OF_COMMANDS or word & 0x80:
            yield f"0x{word:04X} says more than it should"


WORDS = (*Controlword, 0x0010, 0x0102, 0x0003, 0x8000)
WAYS = (*(((word,)) for word in WORDS), (Controlword.FAULT_RESET, Controlword.DISABLE_VOLTAGE), ())


def test_the_tables_keep_to_the_standard() -> None:
    assert list(complaints(PRODUCT)) == []


@pytest.mark.parametrize("name", ["quick_stop", "disable_voltage"])
def test_every_other_controlword_for_a_stop_is_noticed(name: str) -> None:
    held = getattr(PRODUCT, name)
    mutants = [
        Mutant(f"{name} = 0x{word:04X}", _with(PRODUCT, name, word))
        for word in {held ^ 1 << bit for bit in range(16)} | {int(word) for word in Controlword} - {held}
    ]
    assert unnoticed(complaints, mutants) == []


def _with(tables: Tables, field: str, value: Any) -> Tables:
    return replace(tables, **{field: value})


def of(field: str, mutants: Iterator[Mutant]) -> list[Mutant[Tables]]:  # type: ignore[type-arg]
    """The product with one table replaced by each mutant."""
    return [Mutant(one.change, _with(PRODUCT, field, one.table)) for one in mutants]


@pytest.mark.parametrize(
    "mutants",
    [
        lambda: of("stopped", set_mutants("stopped", PRODUCT.stopped, S)),
        lambda: of("down", mapping_mutants("down", PRODUCT.down, WAYS)),
        lambda: of("down", added_mutants("down", PRODUCT.down, LEAVES_BY_ITSELF, [(0x0000,), (0x0080,)])),
        lambda: of("up", mapping_mutants("up", PRODUCT.up, [(word, to) for word in WORDS for to in S])),
        lambda: of(
            "up", added_mutants("up", PRODUCT.up, S, [(Controlword.ENABLE_OPERATION, S.OPERATION_ENABLED)])
        ),
    ],
    ids=["stopped states", "the way down", "added to the way down", "the way up", "added to the way up"],
)
def test_every_change_of_a_table_is_noticed(mutants: Callable[[], list[Mutant[Tables]]]) -> None:
    assert unnoticed(complaints, mutants()) == []


def about_statuswords(coding: tuple[tuple[int, int, DriveState], ...]) -> Iterator[str]:
    """Each low byte of a statusword is the state that the standard says, or none."""
    for word in range(0x100):
        bits = f"{word:08b}"
        said = [state for mask, pattern, state in coding if word & mask == pattern]
        meant = [
            state
            for pattern, state in STATUSWORDS.items()
            if all(one in ("x", bit) for one, bit in zip(pattern, bits, strict=True))
        ]
        if said != meant:
            yield f"0x{word:02X} is {meant}, and is read as {said}"


def test_every_change_of_the_states_coding_is_noticed() -> None:
    coding = cia402._CODING
    assert list(about_statuswords(coding)) == []
    mutants = []
    for at, (mask, pattern, state) in enumerate(coding):
        changed = [(mask ^ 1 << bit, pattern, state) for bit in range(7)]
        changed += [(mask, pattern ^ 1 << bit, state) for bit in range(7)]
        changed += [(mask, pattern, other) for other in S if other is not state]
        mutants += [Mutant(f"{one}", (*coding[:at], one, *coding[at + 1 :])) for one in changed]
    assert unnoticed(about_statuswords, mutants) == []


def test_what_decodes_is_the_coding() -> None:
    for word in range(0x10000):
        meant = [state for mask, pattern, state in cia402._CODING if word & mask == pattern]
        assert cia402.drive_state(word) is (meant[0] if meant else None)
