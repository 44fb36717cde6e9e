"""Models simulated on recorded input: windows, initial states, the fit, and least squares on it."""
