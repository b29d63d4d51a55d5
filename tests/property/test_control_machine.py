"""Sessions, leases, writes, trials, stops, resets, a guard and foreign masters in any order.

One writer; all or nothing; a trial always ends, confirmed or taken back; a stop always answers; nothing that
reads, writes, reverts, stops or resets ever enables a drive; the journal tells exactly what happened.
"""

import tempfile
from collections.abc import Iterable
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, Phase, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from drivers.errors import DeviceAbort
from gateway.records.folder import RecordsFolder
from gateway.records.journal import read_verified
from tests.support.examples import examples
from tests.support.waiting import until
from tests.unit.gateway.harness import (
    DISABLED,
    ENABLED,
    HEAD,
    ROBOT,
    Answered,
    Bench,
    Client,
    FakeDrive,
    config,
    serving,
)

STEP, CYCLE, TOE = "gait.step_length", "gait.cycle_time", "gait.toe_height"
OBJECTS = {STEP: (0x2001, 0), CYCLE: (0x2002, 0), TOE: (0x2003, 0)}
CONTROLWORD = 0x6040
ENABLE_OPERATION = 0x0F

FARTHEST = 100  # that a step length may change at once, there and back
# Counts, few enough to meet again; from one step length to another it is sometimes too far. The height of a
# toe is changed only while no drive can move.
counts = {
    STEP: st.sampled_from([360, 400, 440, 480]),
    CYCLE: st.sampled_from([1100, 1200, 1300]),
    TOE: st.sampled_from([60, 80]),
}
changes = st.fixed_dictionaries({}, optional=counts).filter(bool)
aborts = st.sampled_from([None, None, None, 0, 1])  # at which download of a write the device refuses
people = st.sampled_from(["whoever has the lease"] * 4 + ["ada", "ben"])

GUARD = """
[guard.rule.takes_back]
watch = "joint_limit"
on = ["left_knee"]
max = 1.0
clear_s = 0.001
actions = ["revert_trials"]
[guard.rule.stops]
watch = "joint_limit"
on = ["right_knee"]
max = 1.0
clear_s = 0.001
actions = ["quick_stop"]
"""


class Trial:
    """What the model knows of a write on trial; a `late` one is taken back when the drives allow it."""

    def __init__(self, number: int, before: dict[str, int], written: dict[str, int]) -> None:
        self.number, self.before, self.written = number, before, written
        self.late = False


class ControlMachine(RuleBasedStateMachine):
    """The gateway over fake devices, and a model of it that is a few dictionaries."""

    @initialize()
    def begin(self) -> None:
        self.ending = ExitStack()
        folder = Path(self.ending.enter_context(tempfile.TemporaryDirectory()))
        self.ending.callback(self.the_journal_is_intact)
        patch = self.ending.enter_context(pytest.MonkeyPatch.context())
        self.bench = Bench()
        patch.setattr("gateway.modules.component.module.assemble", self.bench.assemble)
        patch.setattr("gateway.modules.control.trials.LAST_RETRY_S", 0.02)
        patch.setattr("gateway.modules.control.trials.FIRST_RETRY_S", 0.02)
        text = ROBOT.replace(HEAD, HEAD.replace("port = 0", 'port = 0\nrecords = "records"')) + GUARD
        settled = config(folder, text)
        self.folder = RecordsFolder(settled.records)
        self.address = self.ending.enter_context(serving(settled))
        self.clients = {name: self.client() for name in ("ada", "ben", "watcher")}
        self.values = {name: self.held(name) for name in OBJECTS}
        self.lease: str | None = None
        self.trials: list[Trial] = []
        self.late: set[int] = set()  # trials that have had to wait for the drives, also those that ended
        self.stopped = self.at_rest = False
        self.happened: list[str] = []
        until(self.rules_of_guard, "the guard runs")
        self.acquire("ada")

    def person(self, who: str) -> str:
        return who if who in self.clients else self.lease or "ada"

    def client(self) -> Client:
        return self.ending.enter_context(Client(self.address))

    def held(self, name: str) -> int:
        return int.from_bytes(self.bench.gait.node.objects[OBJECTS[name]], "little")

    def refused(self, who: str, method: str, **params: Any) -> str | None:
        """The kind of error that a call is answered with; `None` where it is done."""
        try:
            self.answer = self.clients[who].call(method, **params)
        except Answered as error:
            return error.kind
        return None

    # What people do

    @rule(who=st.sampled_from(["ada", "ben"]), how=st.sampled_from(["acquire"] * 3 + ["release", "vanish"]))
    def come_or_go(self, who: str, how: str) -> None:
        if how == "acquire":
            self.acquire(who)
        elif how == "release":
            assert self.refused(who, "control.release") == (None if self.lease == who else "no_lease")
            self.lease_ends(who, "lease given back")
        else:
            self.clients[who].close()
            self.clients[who] = self.client()
            self.lease_ends(who, "lease lost with the connection")

    @rule(who=people, wanted=changes, aborts_at=aborts)
    def try_(self, who: str, wanted: dict[str, int], aborts_at: int | None) -> None:
        self.write(self.person(who), wanted, True, aborts_at)

    @rule(data=st.data())
    def try_one(self, data: st.DataObject) -> None:
        """Most likely what is on trial already, which it takes over then."""
        self.try_by_whoever_may(data, self.trials[-1].written if self.trials else counts)

    @precondition(lambda self: self.at_rest)
    @rule(data=st.data())
    def try_what_needs_rest(self, data: st.DataObject) -> None:
        self.try_by_whoever_may(data, [TOE])

    def try_by_whoever_may(self, data: st.DataObject, names: Iterable[str]) -> None:
        name = data.draw(st.sampled_from(sorted(names)))
        if self.lease is None:
            self.acquire("ada")
        self.write(self.person("whoever has the lease"), {name: data.draw(counts[name])}, True, None)

    @rule(who=people, wanted=changes, aborts_at=aborts)
    def write_plainly(self, who: str, wanted: dict[str, int], aborts_at: int | None) -> None:
        self.write(self.person(who), wanted, False, aborts_at)

    @precondition(lambda self: self.trials)
    @rule(who=people)
    def confirm(self, who: str) -> None:
        who = self.person(who)
        trial = self.trials[-1]
        changed = any(self.values[name] != value for name, value in trial.written.items())
        expected = "mismatch" if changed else None
        expected = "unknown_name" if trial.late else expected
        expected = "no_lease" if self.lease != who else expected
        assert self.refused(who, "parameter.confirm", write=trial.number) == expected
        if expected is None:
            self.trials.remove(trial)
            self.happened.append("trial confirmed")

    @precondition(lambda self: self.trials)
    @rule(who=people)
    def revert(self, who: str) -> None:
        who = self.person(who)
        trial = self.trials[0]
        expected = "rollback_failed" if self.must_wait(trial) else None
        expected = expected if self.lease == who else "no_lease"
        assert self.refused(who, "parameter.revert", write=trial.number) == expected
        if expected != "no_lease":
            self.take_back(trial)

    @rule(who=st.sampled_from(["ada", "ben", "watcher"]))
    def stop(self, who: str) -> None:
        answer = self.clients[who].call("robot.stop", reason="any")
        assert answer["drives"] == {"left_knee": "confirmed", "right_knee": "confirmed"}
        self.stopped, self.at_rest = True, False
        self.happened += ["stop", "stop answered"]

    @rule(who=people)
    def reset(self, who: str) -> None:
        who = self.person(who)
        expected = None if self.lease == who else "no_lease"
        assert self.refused(who, "robot.reset") == expected
        if expected is None:
            down = dict.fromkeys(("left_knee", "right_knee"), "switch on disabled")
            assert (self.answer["drives"], self.answer["held"]) == (down, False)
            self.stopped = False
            self.happened.append("reset")
            self.drives_rest()

    @rule(who=people)
    def enable(self, who: str) -> None:
        """The robot's file says that another controller leads the bus."""
        who = self.person(who)
        assert self.refused(who, "robot.enable") == ("not_allowed" if self.lease == who else "no_lease")

    @precondition(lambda self: not self.stopped)
    @rule(on=st.booleans())
    def another_master_switches(self, on: bool) -> None:
        for drive in (self.bench.left, self.bench.right):
            drive.set_state(ENABLED if on else DISABLED)
        self.at_rest = False
        if not on:
            self.drives_rest()

    @rule(data=st.data())
    def somebody_else_writes(self, data: st.DataObject) -> None:
        tried = self.trials[-1].written if self.trials else OBJECTS
        name = data.draw(st.sampled_from(sorted(tried)))
        self.values[name] = data.draw(counts[name])
        self.bench.gait.node.objects[OBJECTS[name]] = self.values[name].to_bytes(2, "little")
        for trial in [one for one in self.trials if one.late and not self.must_wait(one)]:
            self.take_back(trial)

    @rule()
    def left_knee_bends_too_far(self) -> None:
        """Its rule takes back what is on trial, whoever has the lease, and stops nothing."""
        self.bends(self.bench.left, "takes_back")
        for trial in tuple(self.trials):
            self.take_back(trial)
        self.straightens(self.bench.left, "takes_back")

    @rule()
    def right_knee_bends_too_far(self) -> None:
        """Its rule stops the robot; the stop is held, and not reset as long as the knee is bent."""
        self.bends(self.bench.right, "stops")
        self.happened += ["stopped again"] if self.stopped else ["stop", "stop answered"]
        self.stopped, self.at_rest = True, False
        until(self.stop_held, "the guard's stop is held")
        if self.lease is not None:
            assert self.refused(self.lease, "robot.reset") == "stopped"
        self.straightens(self.bench.right, "stops")

    # What follows from it

    def acquire(self, who: str) -> None:
        expected = "lease_held" if self.lease not in (None, who) else None
        assert self.refused(who, "control.acquire", ttl_s=300) == expected
        if self.lease is None:
            self.lease = who
            self.happened.append("lease taken")

    def write(self, who: str, wanted: dict[str, int], trial: bool, aborts_at: int | None) -> None:
        self.abort_download(aborts_at)
        params = {"trial_s": 300} if trial else {}
        named = {name: value / 1000 for name, value in wanted.items()}
        kind = self.refused(who, "parameter.write", changes=named, **params)
        self.bench.gait.node.before_download = lambda _index, _data: None
        assert kind == self.expected(who, wanted, trial, aborts_at)
        if kind is None:
            self.wrote(who, wanted, trial)
        elif kind in ("device_abort", "rolled_back"):
            self.happened += ["write", "write taken back"]
        elif kind in ("out_of_limit", "trial_pending", "wrong_state"):
            self.happened.append("write refused")

    def abort_download(self, number: int | None) -> None:
        seen = 0

        def before(_index: int, _data: bytes) -> None:
            nonlocal seen
            seen += 1
            if seen - 1 == number:
                raise DeviceAbort("refused", 0x0800_0000)

        self.bench.gait.node.before_download = before

    def expected(self, who: str, wanted: dict[str, int], trial: bool, aborts_at: int | None) -> str | None:
        if self.lease != who:
            return "no_lease"
        others = [one for one in self.trials if set(wanted) & set(one.written)]
        if any(one.late or not trial for one in others):
            return "trial_pending"
        goals = self.values | {name: value for one in others for name, value in one.before.items()}
        for origin in (self.values, goals if trial else self.values):
            if STEP in wanted and abs(wanted[STEP] - origin[STEP]) > FARTHEST:
                return "out_of_limit"
        if TOE in wanted and not self.at_rest:
            return "wrong_state"
        if aborts_at is None or aborts_at >= len(wanted):
            return None
        order = sorted(wanted, key=lambda name: wanted[name] > self.values[name])
        written = [name for name in order[:aborts_at] if wanted[name] != self.values[name]]
        return "rolled_back" if written else "device_abort"

    def wrote(self, who: str, wanted: dict[str, int], trial: bool) -> None:
        before = {name: self.values[name] for name in wanted}
        self.values |= wanted
        self.happened += ["write", "trial begun" if trial else "write done"]
        if not trial:
            return
        for old in [one for one in self.trials if set(one.written) & set(wanted)]:
            self.trials.remove(old)
            before, wanted = {**before, **old.before}, {**old.written, **wanted}
        self.trials.append(Trial(self.answer["write"], before, wanted))
        assert {name: round(value * 1000) for name, value in self.answer["before"].items()} == before

    def lease_ends(self, who: str, what: str) -> None:
        if self.lease != who:
            return
        self.lease = None
        self.happened.append(what)
        for trial in tuple(self.trials):
            self.take_back(trial)

    def must_wait(self, trial: Trial) -> bool:
        ours = self.values[TOE] == trial.written.get(TOE) != trial.before.get(TOE)
        return ours and not self.at_rest

    def take_back(self, trial: Trial) -> None:
        waits = self.must_wait(trial)
        for name, written in trial.written.items():
            if self.values[name] == written and not (waits and name == TOE):
                self.values[name] = trial.before[name]
        if waits:
            trial.before, trial.written = {TOE: trial.before[TOE]}, {TOE: trial.written[TOE]}
            trial.late = True
            self.late.add(trial.number)
            return
        self.trials.remove(trial)
        if trial.number not in self.late:
            self.happened.append("taken back")

    def drives_rest(self) -> None:
        """What has waited for it is taken back."""
        self.at_rest = True
        for trial in [one for one in self.trials if one.late]:
            self.take_back(trial)

    def rules_of_guard(self) -> dict[str, Any]:
        guard = self.clients["watcher"].call("robot.describe")["guard"]
        return {one["name"]: one for one in guard["rules"]}

    def bends(self, joint: FakeDrive, rule: str) -> None:
        trips = self.rules_of_guard()[rule]["trips"]
        joint.position = 2.0
        joint.give(joint.position, None)
        until(lambda: self.rules_of_guard()[rule]["trips"] > trips, f"{rule} trips")

    def straightens(self, joint: FakeDrive, rule: str) -> None:
        joint.position = 0.5

        def well() -> bool:
            joint.give(joint.position, None)
            return bool(self.rules_of_guard()[rule]["state"] == "cleared")

        until(well, f"{rule} is cleared")

    def told(self) -> list[str]:
        """What the journal says; the guard's alarms are limited by the time between them.

        When what has waited for the drives is taken back, is another matter.
        """
        entries = self.clients["watcher"].call("journal.tail", n=1000)["entries"]
        return [
            one["what"]
            for one in entries
            if not one["what"].startswith(("alarm", "NOT TAKEN BACK")) and not self.is_late_end(one)
        ]

    def is_late_end(self, entry: dict[str, Any]) -> bool:
        return entry["what"] == "taken back" and entry["write"] in self.late

    def described(self) -> dict[int, dict[str, int]]:
        """The trials, and what is written by them."""
        trials = self.clients["watcher"].call("robot.describe")["trials"]
        return {
            one["write"]: {name: round(value * 1000) for name, value in one["values"].items()}
            for one in trials
        }

    def stop_held(self) -> bool:
        held: bool = self.clients["watcher"].call("robot.describe")["stop"]["held"]
        return held

    # What must hold

    @invariant()
    def devices_and_trials_are_as_the_model_says(self) -> None:
        expected = {trial.number: trial.written for trial in self.trials}
        watcher = self.clients["watcher"]
        until(lambda: self.described() == expected, f"trials are {expected}")
        assert {name: self.held(name) for name in OBJECTS} == self.values
        ended = self.late - {trial.number for trial in self.trials}
        entries = watcher.call("journal.tail", n=1000)["entries"]
        assert sorted(one["write"] for one in entries if self.is_late_end(one)) == sorted(ended)
        assert self.folder.undo.exists() == bool(self.trials)
        assert self.stop_held() == self.stopped

    @invariant()
    def nobody_has_enabled_a_drive(self) -> None:
        for drive in (self.bench.left, self.bench.right):
            written = [data for what, index, data in drive.node.log if what == "download"]
            assert not [data for data in written if data and data[0] & ENABLE_OPERATION == ENABLE_OPERATION]
            assert drive.steps == []

    @invariant()
    def the_journal_tells_exactly_what_happened(self) -> None:
        until(lambda: self.told() == self.happened, f"the journal tells {self.happened}")

    def the_journal_is_intact(self) -> None:
        if self.folder.journal.exists():
            read_verified(self.folder.journal)

    def teardown(self) -> None:
        if hasattr(self, "ending"):
            self.ending.close()


ControlMachine.TestCase.settings = settings(
    max_examples=40 if examples(40) == 40 else 6,
    stateful_step_count=50,
    suppress_health_check=list(HealthCheck),
    phases=(Phase.explicit, Phase.reuse, Phase.generate),  # making a failure smaller takes minutes here
)
TestControl = ControlMachine.TestCase
