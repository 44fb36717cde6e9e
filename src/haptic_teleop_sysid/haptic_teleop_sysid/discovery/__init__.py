"""`discover`: the whole chain once, from a robot with concealed physics to a model that simulates it.

`chain` is its order. `drawing` draws the robot and what is hidden in it, `campaign` writes the experiments'
files and runs them, `steps` makes the recordings, `outcome` holds the diagnosis against the opened label,
`overlay` puts the models into the simulated plant and lays simulation and recording over each other,
`conclusion` and `page` tell it. The label is sealed as in `blind`.
"""
