"""What is told of physics without a name: its place, a model, and names that stand beside it."""
