"""Processes that start together, know each other before the first sample, and stop in order."""
