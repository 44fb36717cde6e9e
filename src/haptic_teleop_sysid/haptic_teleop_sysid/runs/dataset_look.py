"""Recordings looked at before anything is estimated: what is suspicious, and what the excitation teaches."""

from __future__ import annotations

from dataclasses import dataclass, replace

from haptic_teleop_control.recording import Recording, StreamQuality, bag_problems
from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.estimation.excitation import NOT_FITTED, Excitation, excitation, refuse_idle
from haptic_teleop_sysid.estimation.records import records_from
from haptic_teleop_sysid.logs.opened import open_recording
from haptic_teleop_sysid.logs.story import reported
from haptic_teleop_sysid.recordings.dataset import DataSet, load_dataset
from haptic_teleop_sysid.recordings.preparation import Treatment, prepare, refuse_huge
from haptic_teleop_sysid.report import Status
from haptic_teleop_sysid.runs.form_errors import widened_by_form
from haptic_teleop_sysid.runs.shape_starts import shape_starts

ILL_CONDITIONED = 1e6
"""Condition of the scaled information beyond which parameters can hardly be told apart."""
WELL_KNOWN = 0.2
"""Expected standard error, relative, up to which a recording is rich enough for a parameter."""

_UNSETTLED = (
    "whether the excitation is rich enough is not known: the quick fit found no optimum, so the errors that "
    "the page expects assume the noise of a model that does not fit; `estimate` tells."
)
_ODD = "Start from other values, or ask `diagnose` for what else it may be."


@dataclass(frozen=True)
class Look:
    """One recording: `quality` by topic; `dataset`, `told` and `excitation` where a model was given."""

    recording: Recording
    quality: dict[str, StreamQuality]
    dataset: DataSet | None = None
    told: tuple[str, ...] = ()
    excitation: Excitation | None = None

    @property
    def problems(self) -> list[str]:
        """Everything suspicious, in sentences."""
        found = [*self.recording.problems]
        for quality in self.quality.values():
            found += [p for p in quality.problems if p not in found]
        return found


def look(name: str, model: Model | None, treatment: Treatment, mapping: str | None = None) -> Look:
    """Read the recording or log ``name`` and judge it; with a ``model``, whether it can teach that model,
    treated as ``treatment`` says. ``mapping``: path of the mapping file of a log.

    Holes are reported, not refused; raises what `refuse_huge`, `open_recording`, `load_dataset`,
    `refuse_idle` and `prepare` raise.
    """
    refuse_huge(name)
    recording = open_recording(name, mapping)
    quality = {topic: bag_problems(series, topic) for topic, series in recording.topics.items()}
    if model is None:
        return Look(recording, quality)
    with reported({name: recording.problems}):
        dataset = load_dataset(recording, model, name, allow_gaps=True)
        refuse_idle(dataset)
        dataset, told = prepare(dataset, recording, model, treatment)
        return Look(recording, quality, dataset, tuple(told), _judged(model, dataset))


def _judged(model: Model, dataset: DataSet) -> Excitation:
    """The excitation, with the errors that `estimate` would give."""
    records = records_from(dataset)
    found = excitation(model, [dataset], shape_starts(model, records))
    return replace(found, expected=widened_by_form(found.expected, found.fit, records)[0])


def judgement(one: Look) -> list[tuple[Status, str]]:
    """Return (status, sentence) of each thing that a report says first."""
    said: list[tuple[Status, str]] = [("fair", f"{sentence}.") for sentence in one.problems]
    if not said:
        said.append(
            ("good", "No gap, no duplicate, no stamp that runs backward, no value that is no number.")
        )
    if one.excitation is not None:
        expected = one.excitation.expected
        low, high = one.excitation.band
        said.append(("plain", f"95 % of the input's power lie between {low:.2g} and {high:.2g} Hz."))
        for name, why in expected.undetermined.items():
            said.append(("bad", f"{name} could not be determined: {why}."))
        if expected.condition > ILL_CONDITIONED:
            told = f"the parameters are hard to tell apart (condition {expected.condition:.1e})"
            said.append(("bad", f"{told}: excite more frequencies."))
        odd = one.excitation.contradictions
        for effect, why in odd.items():
            said.append(("bad", f"{effect} cannot be judged: in a quick fit {why}. {_ODD}"))
        if not one.excitation.fit.converged or one.excitation.fit.message == NOT_FITTED:
            said.append(("fair", _UNSETTLED))
        elif unsure := _unsure(one):
            listed = ", ".join(f"{name} ± {100 * share:.0f} %" for name, share in unsure.items())
            said.append(("fair", f"not well known from this recording: {listed}; excite more, or longer."))
        elif expected.condition <= ILL_CONDITIONED and not expected.undetermined and not odd:
            told = f"the excitation is rich enough for this model (condition {expected.condition:.1e})"
            said.append(("good", f"{told}."))
    return said


def _unsure(one: Look) -> dict[str, float]:
    """Parameters whose expected standard error is a larger share of their size than WELL_KNOWN, with it."""
    if one.excitation is None:
        return {}
    expected, values = one.excitation.expected, one.excitation.fit.model.parameter_values()
    shares = {
        name: float(std) / abs(values[name])
        for name, std in zip(expected.names, expected.std, strict=True)
        if name not in expected.undetermined and values[name]
    }
    return {name: share for name, share in shares.items() if share > WELL_KNOWN}
