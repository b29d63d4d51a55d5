"""Tests of features, models and evaluation, on recordings made up here."""
