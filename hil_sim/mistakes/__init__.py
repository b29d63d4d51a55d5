"""Mistakes that people make with a robot, made on purpose: in its file, drives, wires and computer."""
