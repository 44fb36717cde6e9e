"""A model to start from: structure and parameters by band-limited least squares on the equations of motion.

    rigid body:      J a + b v = u
    flexible joint:  q_m - q_a = (J_a / k) a_a + (b_a / k) v_a,   then   J_m a_m + b_m v_m + k (q_m - q_a) = u

linear in the parameters, after one zero-phase low pass on every term (Swevers, Verdonck and De Schutter,
IEEE Control Systems 27(5), 2007). The input is taken as it is: u in N·m, N, A, V or pu, and every parameter
is per that unit. Where the structure alone explains little, torques that real joints have (dry friction, a
constant, gravity) stand beside it, so that the inertia does not have to explain them.

`joints` lists the joints of a recording, `model` makes the model of one of them from `rigid` or `flexible`,
which read the parameters off `input_fits`. It stands above `estimation`, for it regresses on the inverse
dynamics of `diagnosis`.
"""
