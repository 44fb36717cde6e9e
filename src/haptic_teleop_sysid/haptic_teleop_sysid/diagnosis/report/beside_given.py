"""Is what was found better than the user's own model?  Where it is not, that is said first, and another model
is handed on."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from haptic_teleop_sim.model import Model

from ..evidence.proof import LOWEST, Proof, mean_percent
from ..policy import WORSE

#: Percent of one signal's fit from which a simulation is worse in it.
WORSE_IN_ONE = 2.0
_CALLED = {"augmented": "the augmented model", "baseline": "your structure, re-estimated"}
_HELD = {
    "augmented": "your structure, re-estimated, with {found}",
    "baseline": "your structure, re-estimated",
    "given": "your own model as it came",
}


@dataclass(frozen=True)
class Worse:
    """A model that simulates recordings worse than the user's own: ``given`` and ``fit`` are means over all
    signals, percent; ``signals``: those that are clearly worse, with both fits."""

    model: str
    given: float
    fit: float
    signals: dict[str, tuple[float, float]]

    def content(self) -> dict[str, Any]:
        """The same for a result file."""
        signals = {name: {"given": a, "fit": b} for name, (a, b) in self.signals.items()}
        return {"given": self.given, "fit": self.fit, "signals": signals}

    def sentence(self) -> str:
        """The same in words, without the recordings."""
        text = f"{self.fit:.1f} instead of {self.given:.1f} % over all signals"
        if self.given - self.fit <= WORSE:
            one, (before, after) = max(self.signals.items(), key=lambda item: item[1][0] - item[1][1])
            text = f"{one} {after:.1f} instead of {before:.1f} %, {text}"
        return f"{_CALLED[self.model]} ({text})"


def worse_than_given(proof: Proof, part: str) -> list[Worse]:
    """The augmented and the re-estimated model (one alone where nothing was found) as far as they simulate
    the recordings of ``part`` worse than the given one."""
    found = []
    first = mean_percent(proof.fits["given"][part])
    for model in ("augmented", "baseline"):
        if model == "augmented" and proof.models[model] == proof.models["baseline"]:
            continue
        own = mean_percent(proof.fits[model][part])
        pairs = {n: (max(first[n], LOWEST), max(own[n], LOWEST)) for n in first}
        signals = {n: (a, b) for n, (a, b) in pairs.items() if a - b > WORSE_IN_ONE}
        given, fit = proof.mean("given", part), proof.mean(model, part)
        if given - fit > WORSE or signals:
            found.append(Worse(model, given, fit, signals))
    return found


def handed_on(proof: Proof) -> tuple[str, Model]:
    """Name and content of the model that is written: the one with what was found, the re-estimated one or the
    given one, the first that simulates the recordings that choose no worse than the given one, over all
    signals. A test only shows, so it has no say."""
    for model in ("augmented", "baseline"):
        if proof.mean("given", "validation") - proof.mean(model, "validation") <= WORSE:
            same = proof.models[model] == proof.models["baseline"]
            return ("baseline" if same else model), proof.models[model]
    return "given", proof.models["given"]


def with_numerical_held(model: Model) -> Model:
    """The model with what only the arithmetic of its effects needs (how far a sticking contact gives) held:
    a later `estimate` or `trend` could not find it anew from any recording."""
    held = [
        f"{effect.location}.{effect.effect}.{p.name}"
        for effect in model.effects
        for p in effect.entry.parameters
        if p.numerical and p.name in effect.parameters
    ]
    return replace(model, fixed=(*model.fixed, *(name for name in held if name not in model.fixed)))


def beside_given(proof: Proof, added: str = "what was found") -> dict[str, Any]:
    """For the result file: `augmented_model`, and `worse_than_given` with the sentence that is said first,
    None where there is no reason for one; ``added``: what the augmented model has, in words."""
    part = proof.best_part
    found, held = worse_than_given(proof, part), handed_on(proof)[0]
    worse, holds = None, _HELD[held].format(found=added)
    if found:
        named = " and ".join(w.sentence() for w in found)
        named_anything = proof.models["augmented"] != proof.models["baseline"]
        if named_anything and all(w.model != "augmented" for w in found):
            named += f", but not with {added} ({proof.mean('augmented', part):.1f} %)"
        over_all = any(w.given - w.fit > WORSE for w in found)
        worse = {
            "recordings": part,
            "models": {w.model: w.content() for w in found},
            "sentence": f"Worse than your own model {'on' if over_all else 'in one signal of'} the {part} "
            f"recordings: {named}; augmented_model.yaml holds {holds}",
        }
    return {"augmented_model": {"holds": held, "what": holds}, "worse_than_given": worse}
