"""Tests that a name has to pass beside its likelihood."""
