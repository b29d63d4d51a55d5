"""Tests of one joint on a bench: step, chirp, friction and relay, moved from the robot's own computer."""
