"""Tests: insoles."""
