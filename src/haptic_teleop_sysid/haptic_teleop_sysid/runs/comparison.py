"""Models simulated on the input of recordings, and the fit of each output."""

from __future__ import annotations

from dataclasses import dataclass, field

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.recording import Recording
from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.estimation.excitation import refuse_idle
from haptic_teleop_sysid.estimation.records import with_trusted_input
from haptic_teleop_sysid.estimation.residuals import Residuals, model_residuals
from haptic_teleop_sysid.recordings.dataset import DataSet, load_dataset
from haptic_teleop_sysid.recordings.preparation import with_damage_told
from haptic_teleop_sysid.simulation.fit import SimulatedFit, choose_windows, simulated_fit
from haptic_teleop_sysid.simulation.parameter_fit import ParameterFit, fit_output_error
from haptic_teleop_sysid.simulation.windows import Windows


@dataclass(frozen=True)
class Comparison:
    """Models and bags by the names that the command line gave them.

    `data`, `windows` by bag; `fits` by (model, bag); `fitted` by model where parameters were fitted;
    `residuals` of the one-step predictions by (model, bag), where the model predicts at all.
    """

    models: dict[str, Model]
    data: dict[str, DataSet]
    windows: dict[str, Windows]
    fits: dict[tuple[str, str], SimulatedFit]
    fitted: dict[str, ParameterFit]
    residuals: dict[tuple[str, str], list[Residuals]] = field(default_factory=dict)


def compare(
    models: dict[str, Model],
    recordings: dict[str, Recording],
    window: float | str | None = None,
    span: tuple[float, float] | None = None,
    fit_free_parameters: bool = False,
    allow_gaps: bool = False,
) -> Comparison:
    """Return the fits of all models on all recordings, over the same windows for all models.

    The first model is the baseline: it decides the windows where `window` leaves them open. With
    `fit_free_parameters` each model's free parameters are first fitted to the first recording, and all
    recordings are judged with the result. Raises ConfigurationError for models of different joints, what
    `load_dataset` raises, and RecordingError where there is nothing to fit parameters to.
    """
    joints = {(model.robot, model.joint): name for name, model in models.items()}
    if len(joints) > 1:
        named = " and ".join(f"{name} ({robot} {joint})" for (robot, joint), name in joints.items())
        raise ConfigurationError(f"{named} describe different joints: compare models of one joint at a time.")
    data: dict[tuple[str, str], DataSet] = {}
    for bag, recording in recordings.items():
        for name, model in models.items():
            # As in `estimate`: the offset of a current sense would let a right model drift away.
            dataset = with_trusted_input(load_dataset(recording, model, bag, allow_gaps))
            dataset = with_damage_told(dataset, recording)
            data[name, bag] = dataset if span is None else dataset.between(*span)
    first = next(iter(models))
    windows = {bag: choose_windows(models[first], data[first, bag], window) for bag in recordings}
    fitted: dict[str, ParameterFit] = {}
    if fit_free_parameters:
        learned = next(iter(recordings))
        for name in models:
            refuse_idle(data[name, learned])
        fitted = {
            name: fit_output_error(model, [(data[name, learned], windows[learned])])
            for name, model in models.items()
        }
        models = {name: found.model for name, found in fitted.items()}
    fits = {
        (name, bag): simulated_fit(models[name], dataset, windows[bag])
        for (name, bag), dataset in data.items()
    }
    residuals = {
        (name, bag): found
        for (name, bag), dataset in data.items()
        if (found := model_residuals(models[name], dataset)) is not None
    }
    # The richest data set of a bag (a flexible joint has an arm, a rigid body none) is the one to draw.
    shown = {
        bag: max((data[name, bag] for name in models), key=lambda d: len(d.signals())) for bag in recordings
    }
    return Comparison(models, shown, windows, fits, fitted, residuals)
