"""A law for a measured torque: sparse regression over products of a few functions, written as an entry."""
