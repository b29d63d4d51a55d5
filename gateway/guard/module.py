"""The guard's module: it runs without clients; a rule that trips stops the drives in the thread that saw it.

All else that a rule leads to, the held stop, the journal and what clients see, follows in the loop.
"""

import time
from collections.abc import Mapping
from functools import partial
from typing import TYPE_CHECKING, cast

from drivers.bus.arming import Arming
from gateway.config.guard import GuardSettings, ends, limit, quantities
from gateway.config.guard_rules import Action
from gateway.guard.alarms import ALARM, WHO, Alarms, GuardSource
from gateway.guard.armed_drives import ArmedDrives
from gateway.guard.watcher import RuleState, RuleTransition, Watcher
from gateway.guard.wiring import Wiring
from gateway.handlers import Handlers
from gateway.wire.robot import GuardInfo, GuardRuleInfo

if TYPE_CHECKING:
    from drivers.joint.drive import JointDrive
    from gateway.modules.component.module import ComponentModule
    from gateway.modules.control.module import ControlModule
    from gateway.registry import Context

LOOK_NS = 250_000_000  # how often the loop looks, where no watcher wants to be looked at sooner
LEAST_S = 0.005


class GuardModule:
    """`[guard]` of the robot's file, running."""

    def __init__(self, context: "Context") -> None:
        self._loop = context.loop
        self._component = cast("ComponentModule", context.needs["component"])
        self._control = cast("ControlModule", context.needs["control"])
        self._settings = context.config.guard or GuardSettings()
        self._wirings: dict[str, Wiring] = {}
        self._source = GuardSource(tuple(self._settings.rule))
        self._count = 0
        self._ended = False
        self.handlers = Handlers()

    def start(self) -> None:
        """Begin to watch, and arm the drives as they come up."""
        self._alarms = Alarms(self._loop, self._control.journal.append)
        drives = cast("Mapping[str, JointDrive]", self._control.drives)
        self._armings = ArmedDrives(drives, self._settings.heartbeat_ms, self._arming_changed)
        now_ns = time.monotonic_ns()
        self._wirings = {
            name: Wiring(
                rule,
                self._component.robot,
                now_ns,
                partial(self._changed, name),
                held=lambda: self._control.authority.held,
            )
            for name, rule in self._settings.rule.items()
        }
        for wiring in self._wirings.values():
            wiring.open()
        self._armings.start()
        self._component.sources.append(self._source)
        self._control.authority.standing = lambda: self.standing
        self._control.authority.frozen = lambda: self.frozen
        self._control.armed = lambda name: name in self._armings.armed
        self._loop.post(self._look)

    def stop(self) -> None:
        """Disarm the drives, and watch no more."""
        self._ended = True
        self._component.sources.remove(self._source)
        for wiring in self._wirings.values():
            wiring.close()
        for failure in self._armings.stop():
            self._control.journal.append(WHO, "not disarmed", reason=failure)

    def objection(self) -> str | None:
        """Return why the gateway must not end now, in words; a refused end goes into the journal."""
        why = self._armings.objection()
        if why is not None:
            self._control.journal.append(WHO, "end refused", reason=why)
        return why

    def info(self) -> GuardInfo:
        """Return it as `robot.describe` shows it."""
        return GuardInfo(
            configured=True,
            heartbeat_ms=self._settings.heartbeat_ms,
            rules=[_info(name, wiring) for name, wiring in self._wirings.items()],
            arming=self._armings.texts,
            alarms=self._count,
        )

    # For any thread.

    @property
    def standing(self) -> dict[str, str]:
        """The rules that stop the robot and are tripped at this moment, and why."""
        return self._tripped(Action.QUICK_STOP)

    @property
    def frozen(self) -> str | None:
        """Why no parameter may be changed at this moment, in words; taking back goes on."""
        found = [f"{name} ({why})" for name, why in self._tripped(Action.HOLD_PARAMETERS).items()]
        return f"the guard's rule holds the parameters: {', '.join(found)}" if found else None

    def _tripped(self, action: Action) -> dict[str, str]:
        """Return the rules with this action that are tripped, and why."""
        worst = {
            name: _worst(wiring).last
            for name, wiring in self._wirings.items()
            if action in wiring.rule.actions
        }
        return {name: last.reason for name, last in worst.items() if last.state is RuleState.TRIPPED}

    # In the thread that saw it.

    def _changed(self, name: str, watcher: Watcher, change: RuleTransition) -> None:
        if change.acts and Action.QUICK_STOP in watcher.rule.actions:
            self._control.trip(WHO, _why(name, change))
        self._loop.post(lambda: self._follow(name, watcher, change))

    def _arming_changed(self, joints: str, arming: Arming) -> None:
        what = "armed" if arming.armed else ALARM
        self._loop.post(lambda: self._tell(joints, what, arming.text))

    # In the loop.

    def _follow(self, name: str, watcher: Watcher, change: RuleTransition) -> None:
        if change.acts:
            self._act(name, watcher, change)
        elif change.state is RuleState.BLIND:
            self._tell(name, ALARM, change.reason)
        else:
            self._tell(name, "alarm over", f"{watcher.what} is {change.state.words}")
        self._publish()

    def _act(self, name: str, watcher: Watcher, change: RuleTransition) -> None:
        """Do a trip's actions other than the stop."""
        actions = watcher.rule.actions
        if Action.REVERT_TRIALS in actions:
            self._control.revert_trials(_why(name, change))
        if Action.ALARM in actions:
            self._tell(name, ALARM, change.reason)

    def _tell(self, about: str, what: str, reason: str) -> None:
        if not self._ended:
            self._count += what == ALARM
            self._alarms.tell(about, what, reason)

    def _look(self) -> None:
        """See what has not come; as long as this turns, the gateway counts as alive."""
        if self._ended:
            return
        now_ns = time.monotonic_ns()
        due_ns = now_ns + LOOK_NS
        try:
            for wiring in self._wirings.values():
                due_ns = min(due_ns, *(watcher.look(now_ns) for watcher in wiring.watchers))
            self._publish()
            self._armings.feed()
        finally:
            delay_s = max(LEAST_S, (due_ns - now_ns) / 1e9)
            self._loop.call_later(delay_s, self._look)

    def _publish(self) -> None:
        states = {name: _worst(wiring).state for name, wiring in self._wirings.items()}
        self._source.publish(time.monotonic_ns(), self._count, states)


def _why(name: str, change: RuleTransition) -> str:
    return f"guard rule {name}: {change.reason}"


def _worst(wiring: Wiring) -> Watcher:
    """Return the input that decides a rule's state.

    The one that changed last of those that are equally bad.
    """
    return max(wiring.watchers, key=lambda one: (one.state, one.last.stamp_ns))


def _info(name: str, wiring: Wiring) -> GuardRuleInfo:
    rule, worst = wiring.rule, _worst(wiring)
    low, high = ends(rule)
    has_ends = low is not None or high is not None
    return GuardRuleInfo(
        name=name,
        watch=rule.watch,
        limit=limit(rule),
        on=list(dict.fromkeys(watcher.component for watcher in wiring.watchers)),
        actions=[action.value for action in rule.actions],
        blind=rule.blind.value,
        state=worst.state.words,
        since_ns=worst.last.stamp_ns,
        reason=worst.last.reason or None,
        trips=sum(watcher.trips for watcher in wiring.watchers),
        problems=[watcher.last.reason for watcher in wiring.watchers if watcher.state is RuleState.BLIND],
        quantities=list(quantities(rule)) if has_ends else [],
        low=low,
        high=high,
    )
