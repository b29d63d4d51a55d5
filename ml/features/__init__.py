"""Features: one causal path from samples to numbers, the same live, in training and in replay.

windows.py    the samples before each decision of a recording
stream.py     the same, live
recipe.py     what a model wants to know: rate, look-back, channels, and how its features are computed
gaps.py       samples that never came
signals.py    signals that do not depend on how a sensor is worn
blocks.py     signals of windows → columns
gait_status.py, gait_context.py, gait_phase.py, gait_events.py, falling.py, terrain.py    the recipes
"""

from ml.features.recipe import Recipe, features
from ml.features.stream import FeatureStream

__all__ = ["FeatureStream", "Recipe", "features"]
