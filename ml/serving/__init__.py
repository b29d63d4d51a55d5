"""Serving: from a robot's rows to what its models say of it, live and over recordings alike.

grid.py       rows as they come → samples on a recipe's regular grid
predictor.py  samples → windows that are due → predictions, of many robots at once
trust.py      how far to believe them: whether a robot is still like what its model has learned from
"""
