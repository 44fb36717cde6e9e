"""The sentences of a diagnosis."""

from __future__ import annotations

from typing import Any

from haptic_teleop_sim.effects import EffectParameter
from haptic_teleop_sim.model import Effect

from .search.decide import Choice

#: How something acts of which a result's condition names no quantity that it follows.
_ACTS = {
    "always": "acts always",
    "throughout": "acts throughout",
    "time": "comes and goes with time",
    "which recording it is": "differs between recordings",
}


def called(effect: Effect) -> str:
    """What an effect is called: what has no name in the table of effects is described."""
    if effect.entry.unnamed:
        return f"something without a name ({effect.entry.sentence})"
    return effect.effect


def placed(effect: Effect) -> str:
    """The same with its place: one effect may explain a recording at two of them."""
    return f"{called(effect)} at {effect.location}"


def because(
    choice: Choice,
    fitted: Effect,
    steadily: bool = True,
    surest: float = 1.0,
    beside: Effect | None = None,
) -> str:
    """One sentence a lab engineer understands; ``fitted``: the effect with the numbers of the final model;
    ``beside``: what that has because of the effect and is not named (see `candidates.companion`);
    ``steadily``: whether the recordings speak for it all the time; ``surest``: the most that a rival's
    confidence may be."""
    e = choice.chosen
    sentence = fitted.entry.sentence
    text = f"{sentence[0].upper()}{sentence[1:]} ({_numbers(fitted)}): " + (
        e.grounds
        or f"with it the log-likelihood of the recording rises by {e.gain:.0f}, and that of the other "
        f"recordings, which also choose, by {e.elsewhere:.0f}"
    )
    if beside is not None:
        text += f"; {beside.effect} ({_numbers(beside)}) goes with it at {beside.location}"
    if e.by_current > 0.0:
        text += f"; {e.by_current:.0f} of that come from the measured current"
    if e.beside is not None:
        text += "; the motion follows the command, so that only the record of the current is off"
    mistaken = e.effect.entry.mistaken
    if mistaken is not None and mistaken[0] in e.fit.model.fixed:
        text += f"; {mistaken[1]}"
    if not steadily:
        text += "; the recordings do not speak for it all the time, which limits the confidence"
    if choice.unsure:
        text += f"; {choice.unsure}"
    if choice.others:
        rival, p = choice.others[0]
        share = 100 * min(p, surest)
        text += f"; {rival.effect.effect} at {rival.effect.location} is the runner-up ({share:.0f} %)"
    return text + "."


def _numbers(effect: Effect) -> str:
    values = ((effect.entry.parameter(n), v) for n, v in effect.parameters.items())
    return ", ".join(told(p, v) for p, v in values if p.reported(v))


def told(parameter: EffectParameter, value: float) -> str:
    """A parameter in words: name, value, unit."""
    return f"{parameter.name} {value:.4g} {parameter.unit}"


def chance_sentence(nulls: dict[str, Any]) -> str:
    """What the search found on simulated recordings with nothing hidden, in words."""
    scores, dropped = nulls["scores"], nulls["dropped"]
    gone = f"; {', '.join(dropped)} did not exceed that and is not believed" if dropped else ""
    return (
        f"{nulls['alarms']} of {len(scores)} simulated sets of recordings with nothing hidden would have "
        f"raised an alarm; the best explanation there gains a log-likelihood of {max(scores):.1f}{gone}"
    )


def separating(effects: list[Effect]) -> str:
    """What would separate the first two of these effects."""
    first, second = effects[:2]
    for one, other in ((first, second), (second, first)):
        for name, words in one.entry.separated:
            if name == other.effect:
                return words
    return "an experiment of another amplitude and band in which their predictions differ"


def acts(condition: str) -> str:
    """How something without a name acts, by the condition that a result has for it."""
    return _ACTS.get(condition, f"depends on {condition}")
