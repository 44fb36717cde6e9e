"""The parts of the recorder: topics as bytes, the parameters of other nodes, the verdict at the end."""
