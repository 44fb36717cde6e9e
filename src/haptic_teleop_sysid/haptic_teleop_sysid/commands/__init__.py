"""The commands of this package: arguments, then what they ask of the rest."""
