"""Tests of what must outlive the gateway."""
