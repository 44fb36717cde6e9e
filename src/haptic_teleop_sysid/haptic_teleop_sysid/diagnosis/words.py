"""The sentences of a diagnosis."""

from __future__ import annotations

from typing import Any

from haptic_teleop_sim.effects import EffectParameter
from haptic_teleop_sim.model import Effect

from .decide import Choice

#: What would separate explanations that a recording cannot tell apart.
SEPARATES: dict[frozenset[str], str] = {
    frozenset(
        {"sensor_delay", "channel_skew"}
    ): "no recording of these channels can tell them apart: put one and the "
    "same signal (a tap on the arm with a time-stamped contact) on both channels",
    frozenset(
        {"input_delay", "channel_skew"}
    ): "record the measured current with the clock of the encoders, or close "
    "the loop with a known controller clock",
    frozenset({"input_delay", "actuator_lag"}): "excite up to frequencies above 1 / (2 delay)",
    frozenset({"gravity", "spring_to_ground"}): "move through more than 60 degrees, or rotate the base",
    frozenset(
        {"coulomb_friction", "stribeck_friction"}
    ): "move three times as far and through zero very slowly",
    frozenset({"coulomb_friction", "asymmetric_friction"}): "hold constant speeds in both directions",
    frozenset({"coulomb_friction", "presliding_friction"}): "move below breakaway first, then slide",
    frozenset(
        {"backlash", "hardening_spring"}
    ): "sweep the deflection's amplitude, with and without a bias torque",
    frozenset({"quadratic_drag", "coulomb_friction"}): "drive at three times the speed",
    frozenset({"payload_change", "friction_drift"}): "record again with and without the load",
}


def called(effect: Effect) -> str:
    """What an effect is called: what has no name in the contract's table is described."""
    if effect.entry.unnamed:
        return f"something without a name ({effect.entry.sentence})"
    return effect.effect


def placed(effect: Effect) -> str:
    """The same with its place: one effect may explain a recording at two of them."""
    return f"{called(effect)} at {effect.location}"


def because(choice: Choice, fitted: Effect) -> str:
    """One sentence a lab engineer understands; ``fitted``: the effect with the numbers of the final model."""
    e = choice.chosen
    sentence = fitted.entry.sentence
    numbers = ", ".join(
        told(fitted.entry.parameter(n), v) for n, v in fitted.parameters.items() if reported(n, v)
    )
    text = f"{sentence[0].upper()}{sentence[1:]} ({numbers}): " + (
        e.witnessed
        or f"with it the recording is predicted better by {e.gain:.0f} nats, and the other recordings, which "
        f"also choose, by {e.elsewhere:.0f}"
    )
    if e.by_current > 0.0:
        text += f"; the measured current gives {e.by_current:.0f} of these nats"
    if e.beside is not None:
        text += "; the motion follows the command, so that only the record of the current is off"
    if e.effect.effect == "gain_error" and "stiffness" in e.fit.model.fixed:
        text += (
            "; a stiffness that is believed and off by as much, and with it all inertias and dampings, would "
            "look the same: measure it once more"
        )
    if choice.others:
        rival, p = choice.others[0]
        text += f"; {rival.effect.effect} at {rival.effect.location} is the runner-up ({100 * p:.0f} %)"
    return text + "."


def reported(name: str, value: float) -> bool:
    """Whether a parameter says something about the machine: how a contact was smoothed does not, nor does a
    smoothing of the velocity's sign that was not asked for."""
    return name != "contact_angle" and not (name == "smoothing" and value == 0.0)


def told(parameter: EffectParameter, value: float) -> str:
    """A parameter in words: name, value, unit."""
    unit = "" if parameter.unit == "1" else f" {parameter.unit}"
    return f"{parameter.name} {value:.4g}{unit}"


def chance_sentence(nulls: dict[str, Any]) -> str:
    """What the search found on simulated recordings with nothing hidden, in words."""
    scores, dropped = nulls["scores"], nulls["dropped"]
    gone = f"; {', '.join(dropped)} did not exceed that and is not believed" if dropped else ""
    return (
        f"{nulls['alarms']} of {len(scores)} simulated sets of recordings with nothing hidden would have "
        f"raised an alarm; the best explanation there scores {max(scores):.1f} nats{gone}"
    )


def separating(effects: list[Effect]) -> str:
    """What would separate the first two of these effects."""
    names = frozenset(e.effect for e in effects[:2])
    return SEPARATES.get(
        names, "an experiment of another amplitude and band in which their predictions differ"
    )
