"""Tests of the asking commands."""
