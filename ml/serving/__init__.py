"""Serving: from a robot's rows to what its models say of it, live and over recordings alike.

grid.py       rows as they come → samples on a recipe's regular grid
"""
