"""CAN interfaces: which one serves a name, how its frames come and go, and the state of its link."""
