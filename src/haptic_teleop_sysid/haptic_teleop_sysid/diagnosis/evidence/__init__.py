"""What speaks for and against: other recordings, free runs, innovations, inverse dynamics, the current."""
