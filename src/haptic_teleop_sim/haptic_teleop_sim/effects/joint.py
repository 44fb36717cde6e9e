"""The elastic coupling and what hangs on it: backlash, hardening, hysteresis, damping, load, a mode."""

from __future__ import annotations

import math

from .entry import EffectEntry
from .hypothesis import Numbers, Recorded, bends, noticeable
from .parameter import EffectParameter

#: Share of an encoder's step that a gap is wide at least, and of its mean that an inertia varies by: less is
#: no gap but how readings are rounded. By hand: of some 1200 cases on two seeds of the benchmark all eight in
#: which less than 0.25 and 0.005 gained enough had what was found, and three of them another name instead.
_OF_A_STEP, _OF_THE_MEAN = 0.1, 0.001
#: Cycles per sample up to which a mode is one: near the sampling rate it is but another inertia or a filter;
#: by hand.
_FASTEST = 0.2
#: Share of the arm's inertia that an added part has at most; by hand.
_MOST_OF_THE_ARM = 0.8

#: Share by which the torque of a hysteresis is off, as a standard deviation: how sharply loops bend before
#: they are flat differs among machines. Fitted to loops after Bouc and Wen (exponents 1 to 2, equal
#: coefficients; sines and multisines of 3.5 to 14 times the yield deflection) it is 2 to 13 % too large.
_OF_ITS_KNEE = 0.08


def _changes(p: Numbers, on: Recorded) -> bool:
    """A load that is one, and that changes neither at the beginning nor at the end."""
    return abs(p["inertia"]) > 0.0003 * on.size["inertia"] and 0.02 < p["time"] / on.size["duration"] < 0.98


def _swings(p: Numbers, on: Recorded) -> bool:
    """Slow enough for the samples, not merely dragged along, as with more than critical damping, and not
    the arm itself, whose encoder would sit on hardly anything."""
    swings = p["frequency"] * on.dt < _FASTEST and p["damping_ratio"] < 1.0
    return swings and p["inertia"] < _MOST_OF_THE_ARM * on.size["inertia"]


def _stays_a_spring(p: Numbers, on: Recorded) -> bool:
    """The whole spring, k d + c d^3, gets stiffer, or softens without turning back within the largest
    deflection D: k + 3 c D^2 > 0. A straight spring that is fitted to it has about k + 3/4 c D^2 (describing
    function over a sine: Gelb and Vander Velde, 1968), so that c D^2 is at least -4/9 of that."""
    return p["cubic"] > -4.0 / 9.0 * on.size["cubic"]


BACKLASH = EffectEntry(
    name="backlash",
    kind="torque",
    where=("joint",),
    momentary=True,
    parameters=(
        EffectParameter(
            "width",
            "rad",
            "full width of the gap",
            minimum=0.0,
            typical=0.15,
            scale="deflection",
            grid=(0.05, 0.2),
        ),
    ),
    sentence="the coupling has backlash (play): within a gap it carries no torque",
    equation=lambda s, p: s.stiffness * (s.dead_band(s.position, p.width) - s.position),
    rigid_body=False,
    condition="deflection near zero",
    follows="deflection",
    separated=(("hardening_spring", "sweep the deflection's amplitude, with and without a bias torque"),),
    practical=lambda p, on: p["width"] > _OF_A_STEP * on.coarsest,
    large=True,
    # The faces damp where they touch (Nordin, Galic and Gutman, Int. J. Adapt. Control 11, 1997).
    companion="joint_damping",
)

HARDENING = EffectEntry(
    name="hardening_spring",
    kind="torque",
    where=("joint",),
    parameters=(
        EffectParameter(
            "cubic", "N*m/rad^3", "cubic stiffness (negative: softening)", typical=0.3, scale="cubic"
        ),
    ),
    sentence="the coupling gets stiffer (or softer) the further it is deflected",
    equation=lambda s, p: p.cubic * s.position**3,
    # Up to a deflection of 0.3 rad, and beyond.
    rate=lambda p, ks: (abs(p["cubic"]) * 0.3, 0.0),
    steepness=(
        lambda s, p: s.positive_part(s.abs(p.cubic) * (3 * s.position**2 - 0.3)),
        lambda s, p: 0,
    ),
    rigid_body=False,
    condition="deflection",
    follows="deflection",
    practical=_stays_a_spring,
)

HYSTERESIS = EffectEntry(
    name="hysteresis",
    kind="torque",
    where=("joint",),
    parameters=(
        EffectParameter(
            "torque",
            "N*m",
            "largest torque of the hysteretic part",
            minimum=0.0,
            typical=0.1,
            scale="torque",
            form=_OF_ITS_KNEE,
        ),
        EffectParameter(
            "displacement",
            "rad",
            "deflection over which it builds up",
            minimum=1e-6,
            typical=0.15,
            scale="deflection",
            grid=(0.05, 0.2, 0.6),
            neutral=None,
        ),
    ),
    sentence="loading and unloading the coupling follow different curves (dry friction inside the spring)",
    equation=lambda s, p: p.torque * s.direction,
    rate=lambda p, ks: (abs(p["torque"]) / p["displacement"], 0.0),
    memory="displacement",
    rigid_body=False,
    condition="deflection and its direction",
    follows="deflection",
    practical=noticeable("torque"),
    large=True,
)

JOINT_DAMPING = EffectEntry(
    name="joint_damping",
    kind="torque",
    where=("joint",),
    parameters=(
        EffectParameter(
            "coefficient",
            "N*m*s/rad",
            "torque per rate of deflection",
            minimum=0.0,
            typical=0.1,
            scale="damping",
        ),
    ),
    sentence="the coupling itself damps: a torque proportional to the rate of deflection",
    equation=lambda s, p: p.coefficient * s.velocity,
    rate=lambda p, ks: (0.0, abs(p["coefficient"])),
    rigid_body=False,
    condition="rate of deflection",
)

PRELOAD = EffectEntry(
    name="joint_preload",
    kind="torque",
    where=("joint",),
    parameters=(
        EffectParameter(
            "torque",
            "N*m",
            "torque that the joint carried when its encoders were zeroed",
            typical=0.1,
            scale="torque",
        ),
    ),
    sentence="the encoders were zeroed while the joint carried a load",
    equation=lambda s, p: p.torque,
    rigid_body=False,
    nuisance=True,
)

INERTIAL_COUPLING = EffectEntry(
    name="inertial_coupling",
    kind="torque",
    where=("arm",),
    parameters=(
        EffectParameter(
            "coefficient",
            "kg*m^2",
            "torque per acceleration of the other stage",
            typical=0.1,
            scale="inertia",
        ),
    ),
    sentence="the acceleration of the other stage pulls at this arm",
    equation=lambda s, p: -p.coefficient * s.exogenous,
    exogenous="other_arm_acceleration",
    rigid_body=False,
    condition="acceleration of the other stage",
    large=True,
)

#: Half of the time, s, within which a load is attached: a step would have no derivative by its time. The rate
#: of this hyperbolic tangent is a logistic density, whose standard deviation is pi / sqrt(12) of it.
_ATTACHING = 0.025

PAYLOAD_CHANGE = EffectEntry(
    name="payload_change",
    kind="inertia",
    where=("arm", "motor"),
    momentary=True,
    motor_of_rigid_body=True,
    parameters=(
        EffectParameter(
            "time",
            "s",
            "when the load changes",
            minimum=0.0,
            typical=0.5,
            scale="duration",
            grid=tuple(k / 20 for k in range(1, 20)),
            neutral=None,
            smeared=_ATTACHING * math.pi / math.sqrt(12),
        ),
        EffectParameter(
            "inertia", "kg*m^2", "added inertia (negative: removed)", typical=0.3, scale="inertia"
        ),
    ),
    sentence="the load changes in the course of the recording",
    equation=lambda s, p: p.inertia * (1 + s.tanh((s.time - p.time) / _ATTACHING)) / 2,
    condition="time",
    follows="time",
    separated=(("friction_drift", "record again with and without the load"),),
    practical=_changes,
)

ANGLE_DEPENDENT_INERTIA = EffectEntry(
    name="angle_dependent_inertia",
    kind="relative_inertia",
    where=("arm", "motor"),
    motor_of_rigid_body=True,
    parameters=(
        EffectParameter(
            "amplitude",
            "of the mean inertia",
            "how far the inertia varies about its mean, over its mean",
            minimum=0.0,
            maximum=0.95,
            typical=0.2,
        ),
        EffectParameter(
            "order",
            "cycles/rev",
            "cycles per revolution",
            minimum=0.1,
            # Linkages and folded arms vary once or twice a turn: an order higher than this is another thing.
            maximum=12.0,
            typical=2.0,
            grid=(1.0, 2.0, 4.0),
            neutral=None,
            scan="order",
        ),
        EffectParameter(
            "phase", "rad", "phase at zero angle", typical=0.5, default=0.0, neutral=None, turns="phase"
        ),
    ),
    sentence="the inertia varies with the angle, as that of a linkage or of an arm that folds does",
    # J (1 + a cos(n q + phase)); its torque -J'(q) dq^2 / 2 comes with the kind.
    equation=lambda s, p: p.amplitude * s.cos(p.order * s.position + p.phase),
    lightest=lambda p: 1.0 - p["amplitude"],
    needs="travel over at least a quarter of a cycle, fast or accelerating all the way",
    condition="{q}, with acceleration and {v} squared",
    versatile=True,
    practical=lambda p, on: p["amplitude"] > _OF_THE_MEAN and bends(p, on),
)

EXTRA_MODE = EffectEntry(
    name="extra_flexible_mode",
    kind="torque",
    where=("arm",),
    parameters=(
        EffectParameter(
            "frequency",
            "Hz",
            "natural frequency of the added part on a fixed arm",
            minimum=0.05,
            maximum=200.0,
            typical=4.0,
            grid=(1.0, 2.0, 4.0, 8.0, 16.0),
            neutral=None,
            scan="frequency",
        ),
        EffectParameter(
            "inertia", "kg*m^2", "inertia of the added part", minimum=0.0, typical=0.2, scale="inertia"
        ),
        EffectParameter(
            "damping_ratio",
            "of critical damping",
            "damping ratio of the added part on a fixed arm",
            minimum=0.0,
            maximum=2.0,
            default=0.02,
            neutral=None,
            grid=(0.05,),
        ),
    ),
    sentence="a further flexible part swings at the arm",
    # state0: the added part's angle less the arm's; state1: its velocity.
    equation=lambda s, p: (
        p.inertia
        * (
            (2 * s.pi * p.frequency) ** 2 * s.state0
            + 2 * p.damping_ratio * (2 * s.pi * p.frequency) * (s.state1 - s.velocity)
        )
    ),
    rates=(
        lambda s, p: s.state1 - s.velocity,
        lambda s, p: (
            -((2 * s.pi * p.frequency) ** 2) * s.state0
            - 2 * p.damping_ratio * (2 * s.pi * p.frequency) * (s.state1 - s.velocity)
        ),
    ),
    rate=lambda p, ks: (
        (2 * math.pi * p["frequency"]) ** 2 * abs(p["inertia"]),
        0.0,
        2 * math.pi * p["frequency"] * (1 + 2 * p["damping_ratio"]),
    ),
    rigid_body=False,
    condition="frequency",
    practical=_swings,
)

ENTRIES = (
    BACKLASH,
    HARDENING,
    HYSTERESIS,
    JOINT_DAMPING,
    PRELOAD,
    INERTIAL_COUPLING,
    PAYLOAD_CHANGE,
    ANGLE_DEPENDENT_INERTIA,
    EXTRA_MODE,
)
