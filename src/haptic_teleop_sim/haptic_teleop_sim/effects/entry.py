"""What one entry in the list of effects consists of.

An effect is physics beyond the structure: a torque at the motor, the arm or the joint, a change of
inertia, a map of the commanded torque, or a map of what an encoder reports.  Its entry holds everything
that the rest of the project needs to know of it: equation, parameters with unit, range and typical size,
where it may sit, and one sentence for reports.  Simulation, estimation, diagnosis and documentation read it
from here.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Literal

from .hypothesis import Doubtful, Equivalent, Practical, Refinement
from .parameter import CONTACT, EffectParameter

Kind = Literal[
    "torque", "friction", "friction_factor", "inertia", "relative_inertia", "input", "output", "skew"
]
Place = Literal["motor", "arm", "joint", "actuator", "motor_encoder", "arm_encoder"]


@dataclass(frozen=True)
class EffectEntry:
    """One effect of the vocabulary.

    ``equation(s, p)`` is written once, with sympy symbols, and returns the torque that the effect adds (N·m,
    in the positive direction of its location; at the joint: added to the coupling torque that the motor
    exerts on the arm), the factor on friction, the added inertia (kg·m²; for ``relative_inertia`` over the
    structure's), or the encoder's reading. ``p`` holds the
    effect's parameters by name; ``s`` holds ``position``, ``velocity`` (of the location; at the joint motor
    minus arm), ``deflection`` (motor minus arm), ``stiffness`` (of the structure), ``time``, ``exogenous`` (a
    recorded signal, see ``exogenous``), ``input`` (N·m, what the actuator gives over the sample after its
    input effects), ``deflection_rate``, ``state0`` and ``state1`` (own states), and the helpers of
    ``symbols.py``. ``rates`` gives the time derivatives of the own states in the same symbols. ``rate(p,
    ks)`` bounds the added stiffness (N·m/rad) and damping (N·m·s/rad), from which the step is chosen, and, as
    a third number, the rate of own states (1/s). ``steepness`` gives what these two have beyond that bound at
    a state, in the symbols of ``equation``, for a law of which there is none. An ``input`` effect is a
    compiled function ``step(torque, time, dt, parameters, offset, states, state_offset)`` with ``states``
    places for its memory, the last of them for the moment of what acts where it is ``spread`` unevenly over
    the sample (``actuator.py``).
    An inertia may depend on time and on the angle of its location: the kernel adds the velocity-squared
    torque that belongs to it by Lagrange; ``lightest(p)``: the least that it may become over the structure's.
    ``spring(p)``: what the effect adds to the stiffness against the ground about angle zero, N·m/rad, and
    ``slope(p)``: what an encoder's reading rises by with the angle, in the mean, both of which an observer
    has to know.

    ``s.direction`` is a memory between -1 and 1 that follows the direction of motion of the location over a
    small displacement D, d direction = (dq - abs(dq) direction) / D (Dahl 1968), which the kernel integrates
    exactly; ``memory`` says where D comes from: ``direction`` (the last but one parameter,
    ``contact_angle``, or no memory but tanh(velocity / smoothing) where the last one, ``smoothing``, is
    above zero), ``ratio``
    (first over second parameter), ``displacement`` (second parameter). A ``nuisance`` belongs to how a
    recording was taken: diagnosis fits it where another effect calls for it and never reports it as missing
    physics. A ``momentary`` effect may show at one moment of a recording only. What is ``of_command`` lies
    between a command and the current: a measured current shows what is left already. ``unnamed`` physics is
    not in the table of effects: where it explains more than any name, the verdict is `unknown`.
    ``motor_of_rigid_body``: the motor is its place where nothing hangs on a joint. ``needs``: what a
    recording must have for the effect to show, in words. ``tabulated``: its numbers are a `TorqueMap` beside
    the parameters, which is held fixed, and ``compiled`` (value, and value with derivatives) evaluates it.

    What those read who look for it on recordings (see also ``hypothesis.py``):

    - how it reads: ``sentence``; ``condition``: what it depends on, in words, with ``{q}`` and ``{v}`` for
      angle and velocity, and ``condition_at``: what else at a place; ``follows``: the quantity against which
      its law is drawn; ``separated``: by which experiment it is told from another effect (names
      and words); ``mistaken``: the parameter of the structure that, held at a wrong value, would look the
      same, and the words of that warning;
    - ``practical(p, on)``: whether it deserves its name at these parameters on such recordings (`Recorded`);
      ``doubtful(p, on)``: why nobody is sure of it there although it does, "" for nothing;
    - ``families``: only one of those that share one is tried at a place, they are forms of one thing;
      ``form_of``: the effect that it is a richer form of; ``refinement``: how it is fitted from a plainer
      one, and ``begun_from`` from another thing, of which it is no form, that comes near to it;
      ``other_forms``: equations in which others publish the same law with the same parameters, by which its
      sizes are less sure than by this one alone; ``equivalents``: what looks the same, and when;
      ``same_as``: the parameter of the structure that it cannot be told from where that is estimated;
    - ``ordered``: pairs of its parameters of which the first cannot exceed the second, and why, in words;
    - ``jumps``: the size by which its torque changes its sign where the motion turns, of the plainest form;
    - ``large``: it may be so large that structure and noise make up for it; ``versatile``: it bends to much
      that it is not, and is not believed where what it leaves follows its own quantity; ``at_rest(p)``: the
      torque that it exerts at angle zero, N·m, for what loads a joint at rest; ``companion``: what may go
      with it at the joint and is not named then (a preload with what loads it, damping with a gap);
      ``prior(place, sense_follows)``: how likely it is before looking, where that is not 1.
    """

    name: str
    kind: Kind
    where: tuple[Place, ...]
    parameters: tuple[EffectParameter, ...]
    sentence: str
    equation: Callable[[Any, Any], Any] | None = None
    rates: tuple[Callable[[Any, Any], Any], ...] = ()
    rate: Callable[[dict[str, float], float], tuple[float, ...]] = field(default=lambda p, ks: (0.0, 0.0))
    steepness: tuple[Callable[[Any, Any], Any], Callable[[Any, Any], Any]] | None = None
    exogenous: Literal["", "other_arm_acceleration"] = ""
    step: Callable[..., float] | None = None
    states: int = 0
    spread: bool = False
    spring: Callable[[dict[str, float]], float] | None = None
    slope: Callable[[dict[str, float]], float] | None = None
    lightest: Callable[[dict[str, float]], float] | None = None
    compiled: tuple[Callable[..., float], Callable[..., float]] | None = None
    memory: Literal["", "direction", "ratio", "displacement"] = ""
    rigid_body: bool = True
    motor_of_rigid_body: bool = False
    nuisance: bool = False
    momentary: bool = False
    of_command: bool = False
    unnamed: bool = False
    needs: str = ""
    tabulated: bool = False
    condition: str = ""
    condition_at: tuple[tuple[Place, str], ...] = ()
    follows: Literal["velocity", "angle", "deflection", "input", "input rate", "time"] = "velocity"
    separated: tuple[tuple[str, str], ...] = ()
    mistaken: tuple[str, str] | None = None
    practical: Practical | None = None
    doubtful: Doubtful | None = None
    families: tuple[str, ...] = ()
    form_of: str = ""
    refinement: Refinement | None = None
    begun_from: Refinement | None = None
    other_forms: tuple[Callable[[Any, Any], Any], ...] = ()
    equivalents: tuple[Equivalent, ...] = ()
    same_as: str = ""
    ordered: tuple[tuple[str, str, str], ...] = ()
    jumps: str = ""
    large: bool = False
    versatile: bool = False
    at_rest: Callable[[dict[str, float]], float] | None = None
    companion: str = ""
    prior: Callable[[str, bool], float] | None = None

    def __post_init__(self) -> None:
        if self.equation is not None and self.rates and self.states == 0:
            object.__setattr__(self, "states", len(self.rates))

    @property
    def contact(self) -> str:
        """Name of the parameter that says how far its contact gives; "" for an effect that states none."""
        return CONTACT[0].name if self.memory == "direction" else ""

    def condition_in(self, place: str) -> str:
        """What it depends on at a place, in words; "" where its entry does not say."""
        return next((words for at, words in self.condition_at if at == place), self.condition)

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names in the order in which compiled code receives them."""
        return tuple(p.name for p in self.parameters)

    def parameter(self, name: str) -> EffectParameter:
        """The parameter of that name; KeyError when there is none."""
        for p in self.parameters:
            if p.name == name:
                return p
        raise KeyError(name)
