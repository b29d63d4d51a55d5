"""What a robot's own models predict, from the channels that this robot has.

task.py       the tasks: classes, what labels mean, which sensors support what; the recipe for a robot
groups.py     groups of sensors, by the robot's names of channels
blocks.py     a group's windows → feature columns
learned.py    what has been learned, and what it judges
familiar.py, network.py, checks.py    of it: novelty, the network's outputs, whether a file holds all
learn.py      how it is learned, calibrated, and made to abstain
simulated.py  what the simulator recorded, as examples
"""
