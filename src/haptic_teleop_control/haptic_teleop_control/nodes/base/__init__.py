"""What every node of this project is built on: parameters, faults, commands, command line and loop."""
