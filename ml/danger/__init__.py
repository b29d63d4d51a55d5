"""Early detection of danger: one calibrated probability per robot, from detectors that each give a reason.

observation.py         one sample of a robot, and the phase of its legs in their strides
detector.py            the interface of a detector; a file each: tracking, torque, strides, support, balance,
                       step_timing ("rhythm"), sensor_consistency ("agreement"), overheating ("drift"),
                       encoder_slip ("creep")
nearest_neighbours.py  four detectors that compare a sample with the most similar healthy ones of this robot
baseline.py            the normal range of each measure on this robot
calibration.py         one probability from all detectors; calibration.json: its fit to simulated wearers
false_alarm_budget.py  thresholds from false alarms an hour
levels.py              the levels, and when one begins and ends
monitor.py             all of it for one robot, row by row

The names in quotation marks are those of `calibration.json` and of the reports.
"""
