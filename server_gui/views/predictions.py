"""Predictions about a robot, in marks and words for header and overview; *unknown* too."""

import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final

from ml.danger.detector import DETECTORS
from ml.danger.levels import Level as DangerLevel
from ml.robot.task import ABNORMAL, UNKNOWN
from ml.serving.trust import TrustLevel
from server_gui.core.alarms.texts import UNSTOPPED, Kind
from server_gui.core.alarms.undriven import HELD, IN_FAULT, NONE_ENABLED, STOPPING
from server_gui.core.desk.confidence import NOT_SEEN, Worth, belief, blind, not_judged
from server_gui.core.desk.leg_phase import LegPhase, apart, leg_phase, phase_at
from server_gui.core.desk.station import Station
from server_gui.core.follow.robot import FollowedComponent
from server_gui.core.models.names import model_name, told_name
from server_gui.core.prediction.adaptation import LEARNED_S, TRIED_S, AdaptationState, Adapting
from server_gui.core.prediction.newest_predictions import NOT_YET, STALE_S, Recalled, StationPredictions, Told
from server_gui.core.processing.gait_events import EventSource, Leg
from server_gui.core.tuning.stop import is_off
from server_gui.views.marks import Mark, age_text, enabled_text, state_mark

ACTIVITY, FALLING, GAIT_PHASE = "activity", "falling", "gait_phase"
STEADY: Final = "steady"
FEW: Final = 3  # classes of which one is true: more are no news
LEAST: Final = 0.01  # what is less probable is not worth a word
PROBABLE: Final = re.compile(r" \d+ %$")
TITLES: Final = {FALLING: "Balance", GAIT_PHASE: "Stride"}
LEARNED: Final = {state: ("ring", "dim", state.value) for state in AdaptationState} | {
    AdaptationState.OFFERED: ("diamond", "accent", "offered"),
    AdaptationState.SERVING: ("disc", "accent", "serves"),
    AdaptationState.FAILED: ("triangle", "warn", "failed"),
}  # shape, colour and word of what is learned from the wearer
AGREES: Final = 8.0  # % of a stride, that steps and a model may be apart
STOPPED: Final = "stopped"
BOTH: Final = "steps and model"  # that an agreement or a difference is between
STEPS_BY: Final = {
    EventSource.KINEMATICS: "steps by its joints",
    EventSource.FOOT_IMU: "steps by its foot's IMU",
}
UNDRIVEN: Final = {  # what of such a robot is said where there is little room, by why it is not judged
    HELD: "Stopped",
    STOPPING: "Stopping",
    IN_FAULT: "In fault",
    NONE_ENABLED: "Drives off",
}
OLD: Final = "old"  # what a model said is no prediction any more
NOT_JUDGED: Final = "Not judged"
ACTIVITY_NOT_YET: Final = "its activity is not known yet"
AS_KNOWN: Final = "as far as is known"
WALK: Final = "walk"  # a label of the models
SEEN, SEEN_SHORT = "from the steps seen, without a model", "from the steps seen"
NOT_NAMED: Final = "Wearer not named"
PREDICTED: Final = "predicted"
UNSEEN: Final = "not judged"  # for the model does not see all


@dataclass(frozen=True, slots=True)
class PredictionRow:
    """A mark, what it says, what there is to know of it, in few words too, and all else for a tool tip."""

    mark: Mark
    text: str
    detail: str = ""
    short: str = ""
    tip: str = ""
    brief: str = ""  # all of it where there is the least room
    is_doubtful: bool = False  # the model says itself that it is not to be relied on
    least: str = ""  # of the detail, where it has no room: never less
    is_sure: bool = True  # else its percentage is said beside its detail alone
    is_unchecked: bool = False  # nobody has compared what the model says with what was so

    @property
    def short_text(self) -> str:
        """Without what is said elsewhere."""
        return UNDRIVEN.get(self.detail, self.text)

    @property
    def wordings(self) -> tuple[str, ...]:
        """As one line, the fullest first."""
        alone = [(self.text, "")] if self.is_sure else [(self.brief, self.short)]
        pairs = ((self.text, self.detail), (self.text, self.short), *alone)
        said = [" · ".join(filter(None, pair)) for pair in pairs]
        return tuple(dict.fromkeys((*said, self.brief or self.text)))


def said(shown: Told, *, stopped: str = "", unseen: str = "") -> PredictionRow:
    """Return the row of a prediction: the label and its probability, or *unknown*.

    Of a robot that does not drive its wearer, by what `stopped` says, no task is judged, but a fall stays a
    warning; where the model does not see all, by what `unseen` says, nothing is called abnormal.
    """
    prediction = shown.prediction
    if shown.is_stale():
        return PredictionRow(
            Mark("ring", "old", OLD), "No prediction now", f"the last {shown.age_s():.0f} s ago"
        )
    falls = prediction.task == FALLING and prediction.label not in (STEADY, ABNORMAL, UNKNOWN)
    if stopped and not falls:
        return unjudged(stopped)
    word, worth = label_text(prediction.label), belief(shown)
    details = (" · ".join(filter(None, (worth.wordings[0], _runner_up(shown)))), worth.wordings[-1])
    if prediction.label == ABNORMAL and unseen:
        mark = Mark("ring", "old", UNSEEN)
        return PredictionRow(mark, NOT_JUDGED, unseen, unseen, _tip(shown), least="nothing comes")
    if prediction.label == ABNORMAL:
        novelty = f"novelty {prediction.novelty:.1f}"
        return PredictionRow(
            Mark("triangle", "warn", ABNORMAL), word, f"{novelty} · {details[0]}", novelty, _tip(shown)
        )
    if prediction.label == UNKNOWN:
        return PredictionRow(Mark("ring", "dim", UNKNOWN), word, *details, _tip(shown))
    shape = ("square", "bad") if falls else ("diamond", "accent")
    is_doubtful = worth.worth is Worth.DOUBTFUL  # then a percentage would look sure
    text = f"{word}?" if is_doubtful else f"{word} {100 * prediction.probability:.0f} %"
    is_sure = worth.worth is Worth.CHECKED
    row = PredictionRow(
        Mark(*shape, prediction.label),
        text,
        *details,
        _tip(shown),
        brief="" if is_sure else text if is_doubtful else word,
        is_doubtful=is_doubtful,
        is_sure=is_sure,
    )
    is_unchecked = worth.worth is Worth.UNCHECKED and not isinstance(shown, Recalled)
    if is_unchecked and prediction.task == FALLING and not falls:
        row = replace(row, brief=f"{word}, not checked")
    return _modest(row, word) if is_unchecked and prediction.task == ACTIVITY else row


def _modest(row: PredictionRow, word: str) -> PredictionRow:
    """Return it without its percentage, which would look like how often it is right."""
    said = [f"{PREDICTED}, {one}" for one in (row.detail, row.short)]
    return replace(row, text=word, detail=said[0], short=said[1], is_unchecked=True)


def unjudged(why: str) -> PredictionRow:
    """Return the row of a task that is not judged, and the reason."""
    least = "drives not known" if "drives not known" in why else why
    return PredictionRow(Mark("ring", "dim", STOPPED), NOT_JUDGED, why, why, least=least)


def status(station: Station) -> PredictionRow | None:
    """Return the one line of the header: a fall before all, then activity; None without a model."""
    shown = station.predictions.told
    falling, stopped = shown.get(FALLING), not_judged(station)
    if falling is not None and not falling.is_stale():
        line = said(falling, stopped=stopped, unseen=blind(station))
        if line.mark.colour == "bad":
            return _as_predicted(line)
    if stopped:
        return unjudged(stopped)
    if ACTIVITY not in shown:
        return None
    line = said(shown[ACTIVITY], unseen=blind(station))
    return line if line.mark.word == UNSEEN else _as_predicted(line)  # no prediction is not called one


def activity(station: Station) -> PredictionRow:
    """Return the row of the activity: by a model if it predicts one, else by the detected steps."""
    shown = station.predictions.told.get(ACTIVITY)
    if not station.is_live:
        return PredictionRow(Mark("ring", "old", "not known"), "Activity not known", "no live data")
    stopped = not_judged(station)
    line = None if shown is None else said(shown, stopped=stopped, unseen=blind(station))
    if line is not None and line.mark.word != OLD:
        return line
    return unjudged(stopped) if stopped else by_steps(station)


def by_steps(station: Station) -> PredictionRow:
    """Return what the steps that were seen tell, in the words of the models' labels."""
    walks = station.processing.derived().gait.walking
    why = station.predictions.problem or "the model predicts nothing now"
    if walks is None:
        mark, few = Mark("ring", "old", "not known"), "too few steps seen yet"
        return PredictionRow(mark, "Activity not known", few, "", why)
    if not walks:
        return PredictionRow(Mark("ring", "dim", "no steps"), "No steps", _seen(station), SEEN_SHORT, why)
    return PredictionRow(Mark("diamond", "accent", WALK), label_text(WALK), _seen(station), SEEN_SHORT, why)


def _seen(station: Station) -> str:
    """Return that the steps tell it, and what keeps the model from doing so if there is one."""
    predictions, shown = station.predictions, station.predictions.told.get(ACTIVITY)
    if predictions.problem == NOT_YET and not station.robot.is_recording:
        return f"{SEEN_SHORT}; model not ready yet"
    if shown is None or isinstance(shown, Recalled):
        return SEEN
    learned = {channel.partition(".")[0] for channel in shown.predicted.card.channels}
    lost = [part.name for part in station.robot.not_ok() if part.state in NOT_SEEN and part.name in learned]
    if not lost:
        return f"{SEEN_SHORT}; the model predicts nothing now"
    return f"{SEEN_SHORT}; the model needs the {' and the '.join(lost)}".replace("_", " ")


def doing(station: Station) -> tuple[str, ...]:
    """Return the robot's activity, the fullest wording first: `Walk 74 steps/min · 6 of 6 enabled`."""
    count = enabled_text(station.robot, live=station.is_live)
    if not station.is_live and is_last_held(station):
        return last_held(station)
    if not station.is_live:
        return ("its activity is not known", "not known")
    line, gait = activity(station), station.processing.derived().gait
    if line.mark.word == STOPPED and station.stopping.held:
        worst = station.alarms.worst
        said: tuple[str, ...] = (count, count.replace(" of ", "/"))
        if worst is not None and worst.kind not in {Kind.STOPPED, *UNSTOPPED}:  # else the line above says so
            said = (*(f"STOPPED · {one}" for one in said), "STOPPED")
        return tuple(dict.fromkeys(said))
    walks = gait.walking and gait.cadence_spm is not None and line.mark.word != STOPPED
    between = " " if line.mark.colour == "accent" else " · "  # the steps are not those of what is not known
    short = line.short_text
    cadence = f"{line.text}{between}{gait.cadence_spm:.0f} steps/min" if walks else short
    bare = PROBABLE.sub("", short)
    least = f"{bare} · {count.replace(' of ', '/')}"
    fewest = count.replace(" of ", "/").replace(" enabled", "") if "," in count else count
    return tuple(
        dict.fromkeys(
            (f"{cadence} · {count}", f"{short} · {count}", f"{bare} · {count}", least, count, fewest)
        )
    )


def is_last_held(station: Station) -> bool:
    """Return whether a stop was held, and every drive off, by what has come last: nothing may have since."""
    robot = station.robot
    words = [robot.word(f"{joint}.state") for joint in robot.names("joint")]
    is_held = station.stopping.held and not station.stopping.is_unproven
    return (
        is_held and bool(words) and all(is_off(word) and state_mark(word).colour == "dim" for word in words)
    )


def last_held(station: Station) -> tuple[str, ...]:
    """Return that it was stopped, and for how long nothing has come; a reset may have ended it meanwhile."""
    gone = no_data(station)
    if station.is_linked:
        words = f"STOPPED · {gone}", f"STOPPED · {gone.replace('data for', 'data')}", "STOPPED · no data"
        return *words, "STOPPED"
    return f"STOPPED, {AS_KNOWN} · {gone}", f"STOPPED, {AS_KNOWN}", "STOPPED when last seen", "STOPPED then"


def no_data(station: Station) -> str:
    """Return for how long nothing has come."""
    age_s = station.robot.age_s()
    return "no data" if age_s is None else f"no data for {f'{age_s:.1f} s' if age_s < 1 else age_text(age_s)}"


def lines(station: Station) -> Iterator[PredictionRow]:
    """Yield the overview's lines: balance and stride, rules that hold, devices in trouble."""
    predictions, stopped = station.predictions, not_judged(station)
    for task, title in TITLES.items():
        shown = None if stopped and task == GAIT_PHASE else predictions.told.get(task)
        if shown is not None and not (task == GAIT_PHASE and shown.is_stale()):
            line = said(shown, stopped=stopped, unseen=blind(station))
            if task == FALLING and line.mark.colour == "accent" and (why := _unseen(station)):
                line = PredictionRow(Mark("ring", "old", UNSEEN), UNSEEN, why, why, line.tip)
            if task == GAIT_PHASE and line.mark.colour == "accent":
                line = _stride(station, line)
            if not station.is_live and line.mark.colour != "bad":
                line = PredictionRow(Mark("ring", "old", "not known"), "not known", "no live data")
            yield replace(line, text=f"{title}: {line.text}", brief=_brief(title, line.brief))
    if predictions.problem:
        yield PredictionRow(
            Mark("ring", "old", "no model"), "Not predicted", predictions.problem, "", predictions.problem
        )
    if not stopped and not station.robot.is_recording:
        yield from _danger(predictions)
    for rule in predictions.rules:
        yield PredictionRow(Mark("triangle", "warn", "rule"), f"Rule {rule.rule.action.value}", rule.text)
    worst_last = sorted(station.alarms.each, key=lambda alarm: -alarm.rank)
    told = {alarm.subject: alarm for alarm in worst_last}
    for part in unwell(station):
        alarm = told.get(part.name)
        why = part.problem or (alarm.what if alarm is not None else "no reason known")
        name = part.name.replace("_", " ")
        mark = Mark("square", "bad", part.state) if alarm is None else alarm.mark  # the same as everywhere
        by = _steps_by(station, part.name)
        yield PredictionRow(mark, f"{name}: {mark.word}", " · ".join(filter(None, (why, by))), by, why)
    if (adapting := predictions.adapting) is not None and adapting.text and not adapting.choices:
        yield _learning(adapting)


def unwell(station: Station) -> list[FollowedComponent]:
    """Return the components with which something is wrong: a drive in fault from its first row on.

    What the robot says of a component comes up to a second later.
    """
    faults = {alarm.subject for alarm in station.alarms.each if alarm.kind is Kind.FAULT}
    return [part for part in station.robot.parts.values() if part.state != "ok" or part.name in faults]


def _unseen(station: Station) -> str:
    """Return why a good balance is not believed: what a model needs is not there, or too little was seen."""
    if missing := blind(station):
        return missing
    return ACTIVITY_NOT_YET if station.is_live and activity(station).mark.word == "not known" else ""


def most_needed(rows: list[PredictionRow]) -> list[PredictionRow]:
    """Leave out that the wearer has no name where something is wrong that needs the line."""
    is_wrong = any(row.mark.colour in ("bad", "warn") for row in rows)
    return [row for row in rows if not (is_wrong and row.text == NOT_NAMED)]


def instead_of_insoles(station: Station) -> list[str]:
    """Return what a leg's steps are detected by where its insole is silent: `left by its joints`."""
    silent = (part.name for part in station.robot.not_ok())
    told = ((name.partition("_")[0], _steps_by(station, name)) for name in silent)
    return [f"{leg} {by.removeprefix('steps ')}" for leg, by in told if by]


def _steps_by(station: Station, part: str) -> str:
    """Return what a leg's steps are detected by while its insole is silent; empty of other parts."""
    side, _, kind = part.partition("_")
    leg = next((leg for leg in Leg if leg.value == side and kind == "insole"), None)
    source = None if leg is None else station.processing.derived().sources.get(leg)
    return "" if source is None else STEPS_BY.get(source, "")


def _learning(adapting: Adapting) -> PredictionRow:
    """Return the progress of learning from the wearer, while there is nothing to decide."""
    whom = f"from the steps of {adapting.wearer}"
    text, detail = {
        AdaptationState.UNNAMED: (NOT_NAMED, adapting.text),
        AdaptationState.COLLECTING: (f"Learning {adapting.stepped_s:.0f} of {LEARNED_S:.0f} s", whom),
        AdaptationState.LEARNING: ("Learning", whom),
        AdaptationState.TRYING: (
            f"Trying {adapting.stepped_s:.0f} of {TRIED_S:.0f} s",
            f"what was learned {whom}",
        ),
    }.get(adapting.state, ("Nothing is learned", adapting.text))
    return PredictionRow(Mark(*LEARNED[adapting.state]), text, detail, "", adapting.text)


def _danger(predictions: StationPredictions) -> Iterator[PredictionRow]:
    """Yield the rows of danger: its level and number, then the reasons.

    Nothing old, unknown or unsaid is called fine.
    """
    shown = predictions.danger
    if shown is None:
        if predictions.foresees:
            yield PredictionRow(
                Mark("ring", "old", "not known"), "Danger: not known", "there is no assessment yet"
            )
        return
    verdict = shown.said.verdict
    if not shown.is_known or verdict.number is None:
        mark, text = Mark("ring", "old", "not known"), "Danger: not known"
    else:
        mark = _DANGERS[verdict.level]
        text = f"Danger: {verdict.level.word} {100 * verdict.number:.0f} %"
    speak = f"{verdict.speaking} of {len(DETECTORS)} detectors"
    yield PredictionRow(mark, text, "; ".join(verdict.why) or speak, speak, shown.text)


_DANGERS: Final = {
    DangerLevel.NONE: Mark("diamond", "dim", "none"),
    DangerLevel.EARLY: Mark("triangle", "warn", "early"),
    DangerLevel.ADVICE: Mark("triangle", "warn", "advice"),
    DangerLevel.ALARM: Mark("square", "bad", "alarm"),
    DangerLevel.STOP: Mark("square", "bad", "stop"),
}


def model_phases(station: Station) -> dict[Leg, LegPhase | None]:
    """Return where each leg is in its stride by a model; None where it does not know.

    It does not know without a component that it has learned from. It speaks of the window that it was
    given; since then the stride has gone on.
    """
    shown = station.predictions.told.get(GAIT_PHASE)
    if shown is None or shown.is_stale() or not _knows(shown) or blind(station):
        return dict.fromkeys(Leg)
    derived, values = station.processing.derived(), shown.prediction.values
    late_s = (derived.stamp_ns - shown.prediction.stamp_ns) / 1e9
    found: dict[Leg, LegPhase | None] = dict.fromkeys(Leg)
    for leg in Leg:
        if leg.value in values:
            stride_s = derived.gait.legs[leg].stride_s
            since = 0.0 if stride_s is None or not 0.0 <= late_s <= STALE_S else late_s / stride_s
            percent = 100.0 * ((values[leg.value] + since) % 1.0)
            found[leg] = LegPhase(percent, phase_at(percent))
    return found


def step_phases(station: Station) -> dict[Leg, LegPhase | None]:
    """Return where each leg is in its stride by the steps seen; None where what shows them is not ok now."""
    derived, wrong = station.processing.derived(), {part.name for part in station.robot.not_ok()}
    unseen = {
        leg
        for leg in Leg
        if derived.sources.get(leg) is EventSource.PRESSURE and f"{leg.value}_insole" in wrong
    }
    return {leg: None if leg in unseen else leg_phase(derived, leg, derived.stamp_ns) for leg in Leg}


def label_text(label: str) -> str:
    """Return a label for people."""
    return label.replace("_", " ").capitalize()


def _stride(station: Station, line: PredictionRow) -> PredictionRow:
    """Return the line with the agreement of steps and model; the ring has the numbers."""
    if unseen := blind(station):
        return replace(
            line,
            mark=Mark("ring", "old", UNSEEN),
            text=UNSEEN,
            detail=unseen,
            short=unseen,
            brief="",
            is_sure=True,
        )
    line = replace(line, brief="", is_sure=True)  # what follows has no percentage of the model
    modelled, steps = model_phases(station), step_phases(station)
    pairs = [(steps[leg], modelled[leg]) for leg in Leg]
    differences = [apart(one.percent, other.percent) for one, other in pairs if one and other]
    if not differences:
        return replace(line, text="by the model alone")
    if max(differences) <= AGREES:
        return replace(line, text="steps and model agree", brief="model agrees")
    mark = Mark("triangle", "warn", "differs")
    apart_by = f"{max(differences):.0f} % apart"
    said = f"{BOTH} {apart_by}"
    return replace(line, mark=mark, text=said, brief=said)


def _brief(title: str, brief: str) -> str:
    """Return a brief wording under its title; what says itself between which it is needs none."""
    return brief and (brief if brief.startswith(BOTH) else f"{title}: {brief}")


def _knows(shown: Told) -> bool:
    prediction = shown.prediction
    drifted = not isinstance(shown, Recalled) and shown.predicted.trust.level is TrustLevel.DRIFTED
    return prediction.label not in (UNKNOWN, ABNORMAL) and not drifted


def _as_predicted(line: PredictionRow) -> PredictionRow:
    """Return it as it is said where other things stand beside it; what is old is no prediction."""
    if line.mark.word == OLD:
        return line
    if line.detail.startswith(PREDICTED):
        return line
    return replace(line, detail=" · ".join(filter(None, (PREDICTED, line.detail))))


def _runner_up(shown: Told) -> str:
    """Return the second likeliest class, if it is likely."""
    prediction = shown.prediction
    others = sorted(prediction.probabilities.items(), key=lambda item: -item[1])
    if 1 < len(prediction.either) <= FEW:
        return " or ".join(label_text(name).lower() for name in prediction.either)
    if prediction.label in (UNKNOWN, ABNORMAL):
        return f"likeliest {label_text(others[0][0]).lower()} {100 * others[0][1]:.0f} %" if others else ""
    others = [item for item in others if item[0] != prediction.label and item[1] >= LEAST]
    return f"else {label_text(others[0][0]).lower()} {100 * others[0][1]:.0f} %" if others else ""


def _tip(shown: Told) -> str:
    """Return the model's name for the tool tip."""
    if isinstance(shown, Recalled):
        return f"{told_name(shown.prediction.model)}, {shown.prediction.model}"
    predicted = shown.predicted
    learned = f", learned from {predicted.learned_from}" if predicted.learned_from else ""
    told = [f"{model_name(predicted.card)}{learned}, {predicted.card.id}"]
    return "\n".join(told if predicted.quality is None else [*told, predicted.quality.last_week])
