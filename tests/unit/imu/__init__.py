"""Tests: IMUs."""
