"""Effects' equations on arrays: functions that are asked for the same argument often."""

from __future__ import annotations

import gc
from collections.abc import Callable

import numpy as np

from haptic_teleop_sim.effects import on_arrays
from haptic_teleop_sim.effects.on_arrays import remembering


def counted() -> tuple[list[int], Callable[[np.ndarray], np.ndarray]]:
    calls: list[int] = []

    def sine(x: np.ndarray) -> np.ndarray:
        calls.append(len(x) if np.ndim(x) else 0)
        return np.sin(x)

    return calls, sine


def test_the_same_argument_is_computed_once_and_gives_the_same_bits() -> None:
    calls, sine = counted()
    remembered = remembering(sine)
    angle = np.linspace(-1.0, 1.0, 501)
    first, again = remembered(3.0 * angle), remembered(3.0 * angle)
    assert len(calls) == 1
    assert first.tobytes() == again.tobytes() == np.sin(3.0 * angle).tobytes()


def test_arguments_that_agree_at_the_places_of_the_key_only_are_told_apart() -> None:
    calls, sine = counted()
    remembered = remembering(sine)
    one = np.linspace(-1.0, 1.0, 501)
    other = one.copy()
    other[7] += 1e-12
    assert remembered(one).tobytes() == np.sin(one).tobytes()
    assert remembered(other).tobytes() == np.sin(other).tobytes()
    assert len(calls) == 2


def test_a_result_cannot_be_spoiled_by_who_received_it() -> None:
    remembered = remembering(np.sin)
    assert not remembered(np.linspace(0.0, 1.0, 5)).flags.writeable


def test_what_is_no_array_along_a_motion_goes_through() -> None:
    remembered = remembering(np.sin)
    assert remembered(np.float64(0.5)) == np.sin(0.5)
    assert remembered(np.array([])).size == 0


def test_memory_is_bounded_and_free_again(monkeypatch) -> None:
    room = [50_000_000]
    monkeypatch.setattr(on_arrays, "_ROOM", room)
    calls, sine = counted()
    remembered = remembering(sine)
    long = np.linspace(0.1, 1.0, 1_500_000)  # 12 MB, and as much for the result: two of them fit
    for _ in range(2):
        for factor in (1.0, 2.0, 3.0, 4.0):
            remembered(factor * long)
    assert len(calls) == 6
    assert 0 < room[0] < 3_000_000
    del remembered
    gc.collect()
    assert room == [50_000_000]
