"""Many recordings, and many joints, in one run: each for itself, kept as it is finished, told together."""
