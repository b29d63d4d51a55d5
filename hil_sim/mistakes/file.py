"""Mistakes in the robot's file."""

from hil_sim.mistakes.mistake import FileKey, Mistake

MISTAKES = {
    "eds_product": Mistake(
        "The left ankle's EDS is that of another product.",
        [FileKey("joint.left_ankle", "eds", '"trinamic_tmcm_1270.eds"')],
    ),
    "gear": Mistake(
        "The left knee's gear ratio is half of what it is.",
        [FileKey("joint.left_knee", "gear_ratio", "50.0")],
    ),
    "counts": Mistake(
        "The right hip's encoder is said to count a quarter of what it does.",
        [FileKey("joint.right_hip", "counts_per_revolution", "1024")],
    ),
    "sign": Mistake(
        "The right knee's direction is that of a motor on the other side.",
        [FileKey("joint.right_knee", "direction", "-1")],
    ),
    "joints_swapped": Mistake(
        "The knees' node ids are exchanged: left is right.",
        [FileKey("joint.left_knee", "node_id", "5"), FileKey("joint.right_knee", "node_id", "2")],
    ),
    "insoles_swapped": Mistake(
        "The insoles' ports are exchanged: left is right.",
        [
            FileKey("insole.left_insole", "port", '"{folder}/right_insole"'),
            FileKey("insole.left_insole", "foot", '"left"'),
            FileKey("insole.right_insole", "port", '"{folder}/left_insole"'),
            FileKey("insole.right_insole", "foot", '"right"'),
        ],
    ),
    "zero": Mistake(
        "The right hip's zero is 20° off.",
        [FileKey("joint.right_hip", "zero_offset", "0.35")],
    ),
    "heartbeat_slow": Mistake(
        "The left hip's heartbeat is waited for shorter than it takes.",
        [FileKey("joint.left_hip", "heartbeat_timeout_s", "0.05")],
    ),
    "velocity_unit": Mistake(
        "The left hip's velocity is taken for revolutions a minute.",
        [FileKey("joint.left_hip", "velocity_unit", '"rpm"')],
    ),
    "imu_axes": Mistake(
        "The IMU's axes are those of one that hangs head down.",
        [FileKey("imu.trunk", "axes", '["x", "-y", "-z"]')],
    ),
}
