"""A small robot's file that can be mended."""

TEXT = """\
# a robot
[robot]
name = "x"          # its name
[gateway]
records = "records"
[can.main]
interface = "virtual"
channel = "x"
[joint.left_knee]   # the left one
bus = "main"
node_id = 2
eds = "joint_drive.eds"
counts_per_revolution = 4096
gear_ratio = 50.0   # from the drawing # of 2024
[joint.right_knee]
bus = "main"
node_id = 5
eds = "joint_drive.eds"
counts_per_revolution = 4096
gear_ratio = 50.0
"""
