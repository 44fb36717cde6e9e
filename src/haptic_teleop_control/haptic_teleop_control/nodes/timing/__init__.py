"""When something is done: absolute deadlines of the steady clock, and simulated time."""
