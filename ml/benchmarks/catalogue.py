"""The benchmarks by name: what each asks, of which channels, and what it should reach."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from ml.benchmarks import (
    adapt,
    danger,
    events,
    fall,
    impaired_phase,
    ipol_danger,
    phase,
    sim_activity,
    sim_falling,
    sim_phase,
    sim_walks,
    sisfall_danger,
    status,
    terrain,
)
from ml.benchmarks.outcome import Goal, Outcome
from ml.benchmarks.sim import WHOLE, recipe_of
from ml.features import Recipe
from ml.features.falling import FALLING
from ml.features.foot_rates import PHASES
from ml.features.gait_context import GAIT_CONTEXT
from ml.features.gait_events import LEFT_EVENTS
from ml.features.gait_phase import LEFT_PHASE
from ml.features.terrain import TERRAIN
from ml.robot.task import ACTIVITY, FALLING_TASK, GAIT_PHASE


@dataclass(frozen=True, slots=True)
class Benchmark:
    """One question to recordings, of real people or, where it begins with `sim-`, of simulated ones."""

    name: str
    asks: str
    recipe: Recipe
    run: Callable[[Path, bool], Outcome]
    goals: Mapping[str, Goal]


_DANGER_GOALS: Final[Mapping[str, Goal]] = {
    "foreseen": Goal(0.95),
    "advice_per_hour": Goal(1.0, at_most=True),
    "stops_per_100_h_upper": Goal(1.0, at_most=True),
}
BENCHMARKS: Final = {
    one.name: one
    for one in (
        Benchmark(
            "ipol-status",
            "standing, walking or turning, 200 ms ago; leave one subject out",
            GAIT_CONTEXT,
            status.evaluate,
            {
                "macro_f1": Goal(0.955, stretch=0.97),
                "worst_subject_macro_f1": Goal(0.90, stretch=0.92),
                "steady_macro_f1": Goal(0.975, stretch=0.985),
            },
        ),
        Benchmark(
            "ipol-phase",
            "where in the stride each foot is; leave one subject out",
            LEFT_PHASE,
            phase.evaluate,
            {
                "rmse_percent": Goal(2.7, at_most=True, stretch=2.3),
                "worst_subject_rmse_percent": Goal(4.0, at_most=True, stretch=3.2),
            },
        ),
        Benchmark(
            "ipol-adapt",
            "the same, after a minute of the wearer's own walking",
            LEFT_PHASE,
            adapt.evaluate,
            {"adaptation_cut": Goal(0.20, stretch=0.35)},
        ),
        Benchmark(
            "ipol-events",
            "heel strikes and toe offs within 50 ms, 210 ms ago; leave one subject out",
            LEFT_EVENTS,
            events.evaluate,
            {"heel_strike_f1": Goal(0.97, stretch=0.99), "toe_off_f1": Goal(0.97, stretch=0.98)},
        ),
        Benchmark(
            "impaired-phase",
            "where in the stride patients' feet are, by models of healthy people, and of both",
            PHASES[0],
            impaired_phase.evaluate,
            {"healthy_worst_third_adaptation_cut": Goal(0.5)},
        ),
        Benchmark(
            "sisfall-prefall",
            "an alarm before a fall's impact; five folds of subjects",
            FALLING,
            fall.evaluate,
            {
                "sensitivity": Goal(0.98, stretch=0.99),
                "median_lead_ms": Goal(350.0, stretch=400.0),
                "false_alarm_fraction": Goal(0.03, at_most=True, stretch=0.015),
                "early_alarm_fraction": Goal(0.005, at_most=True, stretch=0.003),
            },
        ),
        Benchmark(
            "aust-mode",
            "level ground, stairs up, stairs down or incline; folds that share no row, and no heading",
            TERRAIN,
            terrain.evaluate,
            {"macro_f1": Goal(0.94, stretch=0.95), "sector_macro_f1": Goal(0.85, stretch=0.88)},
        ),
        Benchmark(
            "ipol-danger",
            "what the shipped danger number says of healthy people, by the trunk's IMU alone",
            danger.DANGER,
            ipol_danger.evaluate,
            {"advice_per_hour": Goal(1.0, at_most=True)},
        ),
        Benchmark(
            "sisfall-danger",
            "the same of falls, 0.3 s before the impact, and of daily life; each person by his own walking",
            danger.DANGER,
            sisfall_danger.evaluate,
            {"foreseen": Goal(0.95), "advice_per_hour": Goal(1.0, at_most=True)},
        ),
        Benchmark(
            "sim-activity",
            "synthetic: what simulated wearers do, 200 ms ago; folds of people",
            recipe_of(ACTIVITY, WHOLE),
            sim_activity.evaluate,
            {},
        ),
        Benchmark(
            "sim-phase",
            "synthetic: where in the stride both legs are; folds of people",
            recipe_of(GAIT_PHASE, WHOLE),
            sim_phase.evaluate,
            {},
        ),
        Benchmark(
            "sim-walks",
            "synthetic: the shipped models on people who walk differently, and after a minute of each",
            recipe_of(GAIT_PHASE, WHOLE),
            sim_walks.evaluate,
            {"worst_third_adaptation_cut": Goal(0.5)},
        ),
        Benchmark(
            "sim-falling",
            "synthetic: an alarm before a fall's impact, and in a stumble; folds of people",
            recipe_of(FALLING_TASK, WHOLE),
            sim_falling.evaluate,
            {},
        ),
        Benchmark(
            "sim-danger",
            "synthetic: dangers foreseen 0.3 s before harm, and false alarms; folds of people",
            danger.DANGER,
            danger.evaluate,
            _DANGER_GOALS,
        ),
        Benchmark(
            "sim-danger-shipped",
            "the same by the calibration that ships, of wearers whom it has not learned from",
            danger.DANGER,
            danger.evaluate_shipped,
            _DANGER_GOALS,
        ),
    )
}
