"""The search: rounds of single effects, the choice among them, and what chance would give."""
