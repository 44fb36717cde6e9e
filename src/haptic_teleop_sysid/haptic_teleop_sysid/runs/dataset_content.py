"""What dataset.json says of a recording."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np

from haptic_teleop_sysid.runs.dataset_look import Look, judgement


def as_json(name: str, one: Look) -> dict[str, Any]:
    """Return what dataset.json says of the recording ``name``; the data set and what it can teach, in the
    units that it names, where a model was given."""
    content: dict[str, Any] = {
        "bag": name,
        "complete": one.recording.complete,
        "experiment": one.recording.experiment,
        "topics": {topic: asdict(quality) for topic, quality in one.quality.items()},
        "problems": one.problems,
        "judgement": [sentence for _, sentence in judgement(one)],
    }
    if one.dataset is not None and one.excitation is not None:
        d, e = one.dataset, one.excitation
        values = e.fit.model.parameter_values()
        content |= {
            "samples": len(d),
            "period_s": d.dt,
            "start_s": d.start,
            "end_s": float(d.time[-1]),
            "input": {
                "source": d.input_source,
                "unit": d.input_unit,
                "rms": float(np.std(d.input)),
                "peak": float(np.max(np.abs(d.input))),
            },
            "signals": {
                n: {"unit": d.units()[n], "min": float(np.min(v)), "max": float(np.max(v))}
                for n, v in d.signals().items()
            },
            "treatment": one.told,
            "band_hz": e.band,
            "condition": e.expected.condition,
            "expected_std": dict(zip(e.expected.names, e.expected.std, strict=True)),
            "expected_relative_std": {
                n: s / abs(values[n]) if values[n] else None
                for n, s in zip(e.expected.names, e.expected.std, strict=True)
            },
            "undetermined": e.expected.undetermined,
        }
    return content
