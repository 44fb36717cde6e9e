"""The blind benchmark: concealed physics drawn by seed, sealed, diagnosed by the command, opened, scored.

The generator (`physics`, `effects`, `outside`, `robot`, `planting`, `cases`, `bags`) has an integrator and
formulas of its own and imports nothing of the simulator or of the tools that it examines; `detect` and
`rivals` say how far an ideal observer could see each hidden effect and what else would explain it; `runner`
starts `diagnose` as a command, `scoring` and `summary` read what it wrote, `baselines` are what people would
otherwise do.
"""
