"""Recordings that a diagnosis can use, the three uses that are kept apart, and their scales."""
