"""Danger, foreseen: one calibrated number a robot, out of detectors that each say why.

now.py        a moment of a robot, and where its legs are in their strides
detector.py   what a detector is; one each: tracking, torque, strides, support, balance, rhythm, agreement,
              drift, creep; memory.py: five that ask one memory of this robot's own moments
usual.py      how large each number usually is on this robot
combine.py    one number out of all; calibration.json: what of it was learned from simulated wearers
budget.py     thresholds from false alarms an hour; levels.py: the levels, and when one begins and ends
watch.py      all of it for one robot, row by row
"""
