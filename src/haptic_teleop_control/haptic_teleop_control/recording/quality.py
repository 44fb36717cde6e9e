"""What is wrong with the times and values of a recorded stream: gaps, lost and repeated samples, jitter,
NaN."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_control.counted import counted
from haptic_teleop_control.recording.series import FIELDS, NANOSECONDS, JointStateSeries

SETTLED = 10  # periods after a late sample within which the following ones may catch up


@dataclass(frozen=True)
class StreamQuality:
    """Times in s; ``problems`` are sentences, empty when nothing is wrong; ``remarks`` may be quite right.

    count         samples; duration between first and last stamp; period: median distance of distinct stamps,
    NaN
                  below two; rate: 1/period, Hz
    lost          samples estimated missing; gaps: (start, length) of each distance over ``gap_periods``
    periods,
                  start relative to the first stamp; longest_gap: the longest distance of stamps
    duplicates    samples with the stamp of the one before; backwards: samples stamped before the one before
    behind        samples stamped before any one before them, which nobody can place; set_back: by how much
                  the clock went back at most
    jitter        standard deviation of distances that are no gaps; jitter_99: 99th percentile of |distance -
    period| latency, latency_99   median and 99th percentile of received - stamp
    non_finite    number of NaN or infinite values, by "joint.field"
    constant      "joint.field" that never changes
    """

    count: int
    duration: float
    period: float
    rate: float
    lost: int
    gaps: tuple[tuple[float, float], ...]
    longest_gap: float
    duplicates: int
    backwards: int
    behind: int
    set_back: float
    jitter: float
    jitter_99: float
    latency: float
    latency_99: float
    non_finite: dict[str, int]
    constant: tuple[str, ...]
    problems: tuple[str, ...]
    remarks: tuple[str, ...]


def bag_problems(series: JointStateSeries, topic: str = "", gap_periods: float = 5.0) -> StreamQuality:
    """Judges one topic by its stamps and values; ``topic`` opens the sentences.

    Samples count as lost only where the ones after a late sample do not catch up with the rhythm, so that
    scheduling jitter is not taken for loss.
    """
    stamp = series.stamp
    steps = np.diff(stamp)
    distinct = np.unique(stamp)
    distances = np.diff(distinct) / NANOSECONDS
    period = float(np.median(distances)) if len(distances) else float("nan")
    gap = distances > gap_periods * period
    steady = distances[~gap]
    latency = (series.received - stamp) / NANOSECONDS
    starts = (distinct[:-1][gap] - distinct[0]) / NANOSECONDS if gap.any() else np.zeros(0)
    quality = {
        "count": len(series),
        "duration": float(distances.sum()),
        "period": period,
        "rate": 1.0 / period if period > 0.0 else float("nan"),
        "lost": _lost(distances, period),
        "gaps": tuple((float(s), float(d)) for s, d in zip(starts, distances[gap], strict=True)),
        "longest_gap": float(distances.max()) if len(distances) else 0.0,
        "duplicates": int((steps == 0).sum()),
        "backwards": int((steps < 0).sum()),
        "behind": int((stamp < np.maximum.accumulate(stamp)).sum()) if len(stamp) else 0,
        "set_back": max(0.0, -float(steps.min()) / NANOSECONDS) if len(steps) else 0.0,
        "jitter": float(np.std(steady)) if len(steady) else 0.0,
        "jitter_99": float(np.percentile(np.abs(steady - period), 99)) if len(steady) else 0.0,
        "latency": float(np.median(latency)) if len(latency) else float("nan"),
        "latency_99": float(np.percentile(latency, 99)) if len(latency) else float("nan"),
        "non_finite": {},
        "constant": (),
    }
    constant: list[str] = []
    absent: list[str] = []
    for field in FIELDS:
        values = getattr(series, field)
        if values is None or not len(values):
            continue
        bad = (~np.isfinite(values)).sum(axis=0)
        same = (values == values[0]).all(axis=0) & (len(values) > 1)
        for name, number, still in zip(series.names, bad, same, strict=True):
            if number == len(values) and field != "position" and bad.min() < number:
                absent.append(f"{name}.{field}")  # others have it: this one was never meant to
            elif number:
                quality["non_finite"][f"{name}.{field}"] = int(number)
            elif still:
                constant.append(f"{name}.{field}")
    quality["constant"] = tuple(constant)
    opening = f"{topic}: " if topic else ""
    problems = tuple(opening + sentence for sentence in [*_sentences(quality, gap_periods), *series.problems])
    remarks = tuple(f"{opening}{signal} never changes" for signal in constant)
    remarks += tuple(f"{opening}{signal} was not recorded" for signal in absent)
    return StreamQuality(**quality, problems=problems, remarks=remarks)


def _lost(distances: NDArray[np.float64], period: float) -> int:
    """Samples missing: around each late one, the periods that passed less the samples that came."""
    late = np.flatnonzero(distances > 1.5 * period)
    if not len(late):
        return 0
    # Late samples closer than SETTLED intervals form one stretch, else one catch-up would be counted twice.
    breaks = np.flatnonzero(np.diff(late) > SETTLED) + 1
    firsts = late[np.concatenate(([0], breaks))]
    lasts = late[np.concatenate((breaks - 1, [len(late) - 1]))]
    ends = np.minimum(lasts + SETTLED + 1, len(distances))
    total = np.concatenate(([0.0], np.cumsum(distances)))
    missing = np.rint((total[ends] - total[firsts]) / period) - (ends - firsts)
    return int(np.maximum(missing, 0).sum())


def _sentences(quality: dict, gap_periods: float) -> list[str]:
    told = []
    if quality["lost"]:
        share = 100.0 * quality["lost"] / (quality["count"] + quality["lost"])
        told.append(f"about {counted(quality['lost'], 'sample is', 'samples are')} lost ({share:.2g} %)")
    if quality["gaps"]:
        start, length = max(quality["gaps"], key=lambda g: g[1])
        told.append(
            f"{counted(len(quality['gaps']), 'gap')} of more than {gap_periods:g} periods, "
            f"the longest of {length:.3f} s after {start:.3f} s"
        )
    if quality["duplicates"]:
        told.append(
            f"{counted(quality['duplicates'], 'sample repeats', 'samples repeat')} the stamp of the one "
            "before"
        )
    if quality["backwards"]:
        told.append(
            f"{counted(quality['backwards'], 'sample is', 'samples are')} stamped earlier than the one before"
        )
    if quality["behind"] > quality["backwards"]:
        told.append(
            f"the clock was set back, by {quality['set_back']:.3f} s at most: "
            f"{counted(quality['behind'], 'sample is', 'samples are')} "
            "stamped earlier than one before and cannot be placed in time"
        )
    if quality["jitter_99"] > 0.5 * quality["period"]:
        told.append(
            "the sampling is uneven: 1 % of the samples are more than "
            f"{quality['jitter_99'] * 1e3:.2f} ms off a period of {quality['period'] * 1e3:.2f} ms"
        )
    for signal, number in quality["non_finite"].items():
        told.append(f"{signal} has {counted(number, 'value that is', 'values that are')} no finite number")
    return told
