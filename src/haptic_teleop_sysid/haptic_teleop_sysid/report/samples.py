"""The samples of long lines, as a page carries them: more than a screen shows, so that zooming shows more.

All lines of a view are one block of bytes, compressed by gzip: values in steps of a 16382th of their range,
as differences from one sample to the next, or those of the differences, whichever are smaller, the high bytes
before the low ones.  Where even that is too much for a page, the least and the greatest of each group of
samples are kept.  `samples.js` unpacks them and draws as
many as there is room for, again at each zoom.
"""

from __future__ import annotations

import base64
import gzip
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .plot import Array, Panel, Plot, Series, thinned

#: Bytes that a page may have, and of these, beside what is counted, a panel's drawing and all texts.
PAGE_BYTES, PANEL_BYTES, TEXT_BYTES = 2_900_000, 9_000, 150_000
#: Samples of a line up to which all are drawn, always: they travel with the drawing.
DRAWN = 2000
#: Samples of a line that are kept at least and at most, and bytes that a sample takes at best.
_LEAST, _MOST, _BEST = 600, 400_000, 0.7
#: What a plot in a folded part may have of what another one has.
FOLDED = 0.25
#: Differences of differences that are tried: smooth lines have small ones.
_ORDERS = (1, 2, 3)
#: Steps of a value, and the one that stands for no number.
_STEPS, _NONE = 16_382, 16_383
#: The greatest word of two bytes.
_WORD = 65_535
#: Part of a period by which times may be off that are counted instead of listed.
_EVEN = 1e-3


@dataclass
class Packed:
    """Lines of a view: ``bytes_`` as base64, and of each line, by panel and place in it, where its values lie
    there and what they mean; ``count``: samples of the longest line, and ``kept`` of them."""

    bytes_: str = ""
    lines: dict[tuple[int, int], dict[str, Any]] = field(default_factory=dict)
    count: int = 0
    kept: int = 0


def stored(plot: Plot, series: Series) -> bool:
    """Whether the samples of a line are packed; those of a short one are drawn as they are."""
    plain = series.line and not series.marks and series.error is None
    return plain and not plot.dated and not plot.names and len(series.value) > DRAWN


def pack(plot: Plot, panels: Sequence[Panel], points: int) -> Packed:
    """Pack the long lines of ``panels``, each with at most about so many ``points``."""
    found, parts, length = Packed(), [], 0
    for number, panel in enumerate(panels):
        for place, series in enumerate(panel.series):
            if not stored(plot, series):
                continue
            time, value = np.asarray(series.time, float), np.asarray(series.value, float)
            few, kept = thinned(np.arange(len(time), dtype=float), value, points)
            line, data = _line(time, few.astype(np.int64), kept)
            found.lines[number, place] = line | {"at": length}
            found.count, found.kept = max(found.count, len(value)), max(found.kept, len(kept))
            parts.append(data)
            length += len(data)
    if parts:
        found.bytes_ = base64.b64encode(gzip.compress(b"".join(parts), 6, mtime=0)).decode("ascii")
    return found


def _line(time: Array, index: np.ndarray, value: Array) -> tuple[dict[str, Any], bytes]:
    """What a line means, and its bytes: the samples at ``index`` of ``time``, and their ``value``."""
    finite = value[np.isfinite(value)]
    low, high = (float(finite.min()), float(finite.max())) if len(finite) else (0.0, 0.0)
    scaled = np.rint((value - low) * (_STEPS / ((high - low) or 1.0)))
    steps = np.where(np.isfinite(value), scaled, _NONE).astype(np.int64)
    tried = {order: _differences(steps, order) for order in _ORDERS}
    order = min(tried, key=lambda one: float(np.mean(np.log2(1.0 + np.abs(tried[one])))))
    line: dict[str, Any] = {"n": len(value), "low": low, "high": high, "order": order}
    data = _planes(tried[order])
    start, period = float(time[0]), float(time[-1] - time[0]) / max(len(time) - 1, 1)
    even = period > 0.0 and np.all(np.abs(time - start - period * np.arange(len(time))) < _EVEN * period)
    if not even or np.max(np.diff(index), initial=0) > _WORD:
        return line, data + time[index].astype("<f4").tobytes()
    line |= {"start": start, "period": period}
    if len(index) == len(time):
        return line, data
    return line | {"jumps": True}, data + _planes(_differences(index, 1))


def _differences(steps: np.ndarray, order: int) -> np.ndarray:
    """Differences (n,) from one number to the next, ``order`` times; the first is from zero. Modulo the size
    of a word, and as near to zero as that allows."""
    for _ in range(order):
        steps = np.diff(steps, prepend=0)
    half = (_WORD + 1) // 2
    return (steps + half) % (_WORD + 1) - half


def _planes(steps: np.ndarray) -> bytes:
    """Whole numbers (n,) as words of two bytes: all high bytes, then all low ones."""
    words = (steps % (_WORD + 1)).astype("<u2")
    return (words >> 8).astype(np.uint8).tobytes() + (words & 255).astype(np.uint8).tobytes()


def pack_all(views: Sequence[tuple[Plot, Sequence[Panel], bool]], taken: int) -> list[Packed]:
    """Pack all views of a page, of which some are ``folded``, with as many samples as it has room for beside
    what else is in it: ``taken`` bytes, panels and texts."""
    room = PAGE_BYTES - taken - TEXT_BYTES - PANEL_BYTES * sum(len(panels) for _, panels, _ in views)
    shares = [FOLDED if folded else 1.0 for *_, folded in views]
    counts = [
        (len(s.value), share)
        for (plot, panels, _), share in zip(views, shares, strict=True)
        for p in panels
        for s in p.series
        if stored(plot, s)
    ]
    points = _points(counts, room / _BEST)
    while True:
        found = [
            pack(plot, panels, max(int(share * points), _LEAST))
            for (plot, panels, _), share in zip(views, shares, strict=True)
        ]
        size = sum(len(one.bytes_) for one in found)
        if size <= room or points <= _LEAST:
            return found
        samples = sum(min(n, max(share * points, _LEAST)) for n, share in counts)
        points = min(_points(counts, 0.95 * room * samples / size), 0.9 * points)


def _points(counts: Sequence[tuple[int, float]], samples: float) -> float:
    """Samples that a line may have for all together to have ``samples``; ``counts``: of each line how many
    there are, and its share."""
    low, high = float(_LEAST), float(_MOST)
    for _ in range(24):
        middle = 0.5 * (low + high)
        fits = sum(min(n, share * middle) for n, share in counts) <= samples
        low, high = (middle, high) if fits else (low, middle)
    return low


def kept_words(packed: Packed) -> str:
    """What stands under a plot of which not all samples are drawn; empty where all are."""
    if not packed.count:
        return ""
    told = f"Up to {packed.count} samples a line: seen whole, the least and greatest of each group are drawn"
    if packed.kept >= packed.count:
        return f"{told}; zoomed in, every sample."
    group = 2.0 * packed.count / packed.kept
    return (
        f"{told}; zoomed in, {packed.kept} points at most stand for them, the least and greatest of each "
        f"{group:.0f} samples."
    )
