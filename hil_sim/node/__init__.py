"""A CANopen device as CiA 301 describes it: dictionary, SDO server, NMT slave, PDOs, EMCY."""
