"""Evaluation: benchmarks on recordings of people, real or simulated, who are never on both sides.

catalogue.py                their names, questions and goals
status.py, phase.py, adapt.py, fall.py, terrain.py    one each
impaired_phase.py           of patients, by groups: on impaired.py, impaired_strides.py, impaired_groups.py
ipol.py, sisfall.py, arrays.py    how recordings are read and checked
ipol_danger.py, sisfall_danger.py    the danger number on recorded people; danger_trunk.py: how it sees them
sim_activity.py, sim_phase.py, sim_falling.py    those on simulated people, one each
sim_walks.py                the shipped models on simulated people who walk differently
sim.py                      what these share: folds, missing sensors, noise
strides.py                  decisions within strides, for phase.py and adapt.py
folds.py, search.py, metrics.py   splits, tuning on training subjects alone, figures
outcome.py, report.py       what was found, and a page about it
"""

from ml.benchmarks.catalogue import BENCHMARKS, Benchmark
from ml.benchmarks.outcome import Goal, Outcome
from ml.errors import UnusableData

__all__ = ["BENCHMARKS", "Benchmark", "Goal", "Outcome", "UnusableData"]
