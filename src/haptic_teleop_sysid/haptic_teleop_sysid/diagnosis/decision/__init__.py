"""From evidence to a verdict: rounds of the search, the choice, doubts, what something unknown is."""
