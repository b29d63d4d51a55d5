"""Objects of CANopen devices that are no parameters as others are."""

CONTROLWORD = 0x6040
AXIS_OFFSET = 0x800  # between the objects of a multi-axis drive's axes (CiA 402-2)
STORE, RESTORE = 0x1010, 0x1011
