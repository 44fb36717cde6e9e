"""Parameter estimation by prediction error: noise model, Gauss-Newton, uncertainty."""
