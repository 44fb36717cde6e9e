"""The parts of the force controller: its topics, the order of its answers in simulated time, its report."""
