"""A robot's own models, for the channels that this robot has.

classes.py    what they say: the names alone
task.py       the tasks: classes, what labels mean, which sensors support what; the recipe for a robot
groups.py     groups of sensors, by the robot's names of channels
blocks.py     a group's windows → feature columns
learned.py    what has been learned, and what it judges
novelty.py    how unlike an input is to what has been learned from
network.py    a small network's outputs
checks.py     whether a file holds all of a model
learn.py      how it is learned, calibrated, and made to abstain
"""
