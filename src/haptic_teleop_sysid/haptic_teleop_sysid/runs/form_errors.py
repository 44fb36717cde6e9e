"""Standard errors that also cover the other published forms of a law (`other_forms`)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.band import motion_band
from haptic_teleop_sysid.diagnosis.evidence.other_forms import spread_by_form
from haptic_teleop_sysid.estimation.fit import Fit
from haptic_teleop_sysid.estimation.records import Record
from haptic_teleop_sysid.estimation.result import Estimate
from haptic_teleop_sysid.estimation.uncertainty import Uncertainty, widened


def with_forms(found: Estimate, records: Sequence[Record]) -> Estimate:
    """The estimate with standard errors that cover other forms of its effects' laws along ``records``."""
    if found.fit is None or found.uncertainty is None:
        return found
    unsure, by_form = widened_by_form(found.uncertainty, found.fit, records)
    return replace(found, uncertainty=unsure, by_form=by_form)


def widened_by_form(
    unsure: Uncertainty, fit: Fit, records: Sequence[Record]
) -> tuple[Uncertainty, dict[str, float]]:
    """The uncertainty of a fit with the spread between the forms, and that spread by parameter, in its unit;
    empty for a model whose laws have one form."""
    if not any(effect.entry.other_forms for effect in fit.model.effects):
        return unsure, {}
    spread = spread_by_form(fit.model, records, motion_band(records))
    return widened(unsure, fit, spread), spread
