"""What may be believed of an estimate: its problems, what else is to be known, and the one thing to do."""

from __future__ import annotations

from dataclasses import dataclass

from haptic_teleop_control.counted import counted
from haptic_teleop_sysid.estimation.result import Estimate
from haptic_teleop_sysid.report import Status, unit_text
from haptic_teleop_sysid.runs.comparison_pictures import percent_text
from haptic_teleop_sysid.runs.estimation_doubts import alike, doubts
from haptic_teleop_sysid.runs.estimation_result import Result, units_of
from haptic_teleop_sysid.runs.parameter_table import NUMBERS, Row, parameter_rows
from haptic_teleop_sysid.runs.undetermined import remedy, undetermined_sentence, without_scale
from haptic_teleop_sysid.simulation.windows import closed_loop

_MISSING = "let diagnose find what is missing."


@dataclass(frozen=True)
class Commands:
    """What to paste after an estimate: ``diagnose`` says what is missing from the model, ``again`` estimates
    from several starts; empty where nobody knows the command line."""

    diagnose: str = ""
    again: str = ""


@dataclass(frozen=True)
class Problem:
    """Why parameters are not to be used: in one sentence, and what it rests on. ``search``: the search is to
    blame, not the model; ``scale``: what is estimated is to blame."""

    headline: str
    details: tuple[str, ...] = ()
    search: bool = False
    scale: bool = False


def problems(result: Result) -> list[Problem]:
    """What forbids to use the parameters, the weightiest first; empty where nothing does."""
    found = result.estimate
    told: list[Problem] = []
    if without_scale(found.model):
        told.append(
            Problem(
                "Nothing fixes the scale of the torques: torque_constant may grow with all inertias, "
                "dampings and torques together, and no recording tells by how much. Do not use these "
                "numbers.",
                scale=True,
            )
        )
    if not found.converged:
        headline = f"The search did not end at an optimum: {found.message}. Do not use these numbers."
        told.append(Problem(headline, search=True))
    for effect, why in found.contradictions.items():
        told.append(Problem(f"{effect}: {why}. Do not use its numbers."))
    if found.misled is not None:
        headline = "Something quick is missing from the model: these parameters do not hold for quick motion."
        told.append(Problem(headline, (misled_sentence(found),)))
    if found.disagreement():
        told.append(_missing(result))
    return told


def is_doubted(result: Result) -> bool:
    """Whether a problem, or physics that seems to be missing, makes the standard errors too small."""
    return bool(problems(result) or doubts(result))


def rows_of(result: Result) -> list[Row]:
    """The rows of the table of parameters, as far as they can be trusted."""
    return parameter_rows(result.estimate, units_of(result), is_doubted(result))


def _missing(result: Result) -> Problem:
    """Parameters that another predictor puts elsewhere."""
    found, units = result.estimate, units_of(result)
    values = found.model.parameter_values()
    ahead = 0.0 if found.far_sighted is None else found.far_sighted.ahead
    apart = []
    for name, other in found.disagreement().items():
        unit = unit_text(units.of_parameter(found.model, name))
        apart.append(f"{name} {other:.4g} instead of {values[name]:.4g} {unit}".rstrip())
    looped = any(closed_loop(result.data[b]) for b in result.data if b not in result.validation)
    other = "something acts that nobody recorded" if looped else "the measured input is noisy"
    return Problem(
        "Something is missing from the model: these parameters do not hold for slow motion.",
        (
            f"The parameters predict the next sample best. Those that predict {ahead:.2g} s ahead best, "
            f"where slow motion counts for more, differ by more than chance: {', '.join(apart)}.",
            f"Of a right model both are the same. If `diagnose` finds nothing, {other}.",
        ),
    )


def notes(result: Result) -> list[tuple[Status, str]]:
    """(status, sentence) of what else is to be known: physics that seems to be missing, convergence, what is
    undetermined, what the recordings lack."""
    found = result.estimate
    further = doubts(result)[0 if problems(result) else 1 :]  # the first one stands in the conclusion
    told: list[tuple[Status, str]] = [(doubt.status, doubt.sentence) for doubt in further]
    for one, other, together in alike(result):
        ratio = "ratio" if together > 0.0 else "product"
        sentence = f"{one} and {other} are correlated by {together:+.2f}: their {ratio} is known far better"
        told.append(("plain", f"{sentence} than either, and what the model leaves out shifts both."))
    if found.converged:
        told.append(
            ("good", f"The search ended at an optimum after {found.iterations} iterations ({found.message}).")
        )
    if found.uncertainty is not None:
        for name in found.uncertainty.undetermined:
            asked = remedy(found, name)
            told.append(("fair", f"{undetermined_sentence(found, name)} {asked[0].upper()}{asked[1:]}"))
        if found.far_sighted is not None and not found.far_sighted.values:
            told.append(("plain", "The cross-check by looking further ahead did not arrive: it is silent."))
        for name in found.uncertainty.near_zero:
            told.append(("plain", f"{name} cannot be told from zero."))
    else:
        sentence = "its standard errors, where it has any, hold for an open loop and a right model only"
        told.append(("fair", f"{found.method} knows no noise: {sentence}."))
    for bag, dataset in result.data.items():
        for problem in dataset.problems:
            told.append(("fair", f"{bag}: {problem}."))
    return told


def conclusion(result: Result, commands: Commands) -> tuple[Status, str, str, str]:
    """How good it is, what was estimated, what to do, and the command for that ("" for none)."""
    found, wrong = result.estimate, problems(result)
    count = sum(1 for row in rows_of(result) if row.status in NUMBERS)
    before, after = result.mean_fit("start"), result.mean_fit("estimate")
    where = "recordings that were not used" if result.validation else "the recordings that were used"
    happened = (
        f"{counted(count, 'parameter')} of {found.model.joint} estimated: on {where} the mean fit goes from "
        f"{percent_text(before)} to {percent_text(after)} %."
    )
    if wrong:
        return "bad", f"{wrong[0].headline} {happened}", *_remedy(wrong[0], found, commands)
    if reasons := doubts(result):
        status: Status = reasons[0].status
        return status, f"{happened} {reasons[0].sentence}", _MISSING, commands.diagnose
    if found.uncertainty is not None and found.uncertainty.undetermined:
        name = next(iter(found.uncertainty.undetermined))
        return "fair", happened, remedy(found, name), ""
    if any(status == "fair" for status, _ in notes(result)):
        todo = "model.yaml holds the estimate; read the notes below before you use it."
        return "fair", happened, todo, ""
    if after < before:
        return "fair", happened, "the start was nearer: see where in the picture, with Difference.", ""
    judged = "" if result.validation else ", and judge it on another recording"
    return "good", happened, f"model.yaml holds the estimate: simulate with it{judged}.", ""


def _remedy(problem: Problem, found: Estimate, commands: Commands) -> tuple[str, str]:
    """The one thing to do, and its command."""
    if problem.scale:
        return "add torque_constant to `fixed` in the model, or give --fix torque_constant, and again.", ""
    if not problem.search:
        return _MISSING, commands.diagnose
    if len(found.starts) > 1 and found.method == "prediction-error":
        return "state start values nearer to the machine with --start, or hold parameters with --fix.", ""
    if found.method != "prediction-error":
        return (
            "estimate by prediction-error, which begins at several places and over the shapes of effects; "
            f"{found.method} begins at one.",
            commands.again,
        )
    return "begin at several places.", commands.again


def misled_sentence(found: Estimate) -> str:
    """What is said where the one-step predictor was not believed."""
    misled = found.misled
    assert misled is not None
    values = found.model.parameter_values()
    apart = [
        f"{name} {other:.4g} instead of {values[name]:.4g}"
        for name, other in misled.values.items()
        if abs(other - values[name]) > 0.1 * abs(values[name])
    ]
    return (
        "Something quick is missing from the model, and it misleads the one-step predictor"
        + (f" ({', '.join(apart)})" if apart else "")
        + f": simulated with its values, the angles err by {100 * misled.error:.3g} % of their spread, with "
        f"those shown by {100 * misled.error_ahead:.3g} %. Shown are those of a predictor that looks some "
        f"{misled.ahead:.2g} s ahead."
    )
