"""Independent fits on several threads: the same results in the same order as on one."""

import threading
import time

import numpy as np
import pytest
from identification_plants import STAGE, off

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_sim.kernel import pack, simulate
from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.diagnosis.decision.search.explore import explore
from haptic_teleop_sysid.diagnosis.hypotheses.candidates import candidates
from haptic_teleop_sysid.diagnosis.inputs.scales import recording_scales
from haptic_teleop_sysid.diagnosis.starts.screen import screen
from haptic_teleop_sysid.estimation.parallel import (
    VARIABLE,
    by_itself,
    side_by_side,
    thread_count,
    within_memory,
)
from haptic_teleop_sysid.estimation.records import Record
from haptic_teleop_sysid.estimation.tuning import initial_noise
from haptic_teleop_sysid.estimation.whole_fit import fit_from_scratch, fit_whole

DT, N = 2e-3, 3000


@pytest.fixture(scope="module")
def records():
    """Two recordings of a stage with dry friction."""
    truth = STAGE.with_effects(Effect("coulomb_friction", "stage1_motor", {"torque": 0.08}))
    made = []
    for seed in (1, 2):
        rng = np.random.default_rng(seed)
        current = np.repeat(rng.uniform(-0.3, 0.3, N // 20), 20)
        run = simulate(truth, current, DT)
        angles = np.column_stack([run.motor_position, run.arm_position])
        angles += 1e-4 * rng.standard_normal(angles.shape)
        made.append(Record(f"made {seed}", DT, current, angles, np.zeros(N), (7e-5, 3.5e-4)))
    return made


def test_results_come_in_the_order_of_what_was_given(monkeypatch):
    monkeypatch.setenv(VARIABLE, "4")

    def late(k):
        time.sleep(0.002 * (10 - k))
        return k

    assert side_by_side(late, range(10)) == list(range(10))
    assert side_by_side(late, []) == []


def test_as_many_threads_work_at_once_as_are_allowed_and_theirs_begin_no_more(monkeypatch):
    monkeypatch.setenv(VARIABLE, "3")
    gate = threading.Barrier(3, timeout=20.0)

    def met(k):
        gate.wait()
        return {threading.get_ident(), *side_by_side(lambda _: threading.get_ident(), range(4))}

    threads = side_by_side(met, range(3))
    assert [len(one) for one in threads] == [1, 1, 1]
    assert len(set.union(*threads)) == 3
    here = by_itself(side_by_side, lambda _: threading.get_ident(), range(4))
    assert set(here) == {threading.get_ident()}


def test_long_recordings_are_fitted_on_no_more_threads_than_memory_has_room_for(monkeypatch):
    monkeypatch.setenv(VARIABLE, "3")

    def here():
        """Whether items are worked on one after another, on this thread."""
        return {threading.get_ident()} == {*side_by_side(lambda _: threading.get_ident(), range(3))}

    with within_memory(500_000):
        assert here()
        with within_memory(60_000):
            assert not here()
        assert here()
    assert not here()
    with within_memory(10**9):
        assert here()


def test_an_error_of_one_is_raised_and_nothing_more_is_begun(monkeypatch):
    monkeypatch.setenv(VARIABLE, "2")
    begun = []

    def fails(k):
        begun.append(k)
        time.sleep(0.01)
        raise ValueError(k)

    with pytest.raises(ValueError, match="0"):
        side_by_side(fails, range(100))
    assert len(begun) < 50


@pytest.mark.parametrize("wrong", ["0", "-1", "many", "1.5"])
def test_a_wrong_number_of_threads_is_refused(monkeypatch, wrong):
    monkeypatch.setenv(VARIABLE, wrong)
    with pytest.raises(ConfigurationError, match=VARIABLE):
        thread_count()
    monkeypatch.delenv(VARIABLE)
    assert thread_count() >= 1


def test_fits_and_screening_do_not_depend_on_the_number_of_threads(records, monkeypatch):
    found = []
    for threads in ("1", "3"):
        monkeypatch.setenv(VARIABLE, threads)
        fit = fit_from_scratch(off(STAGE, 1), records)
        scales = recording_scales(fit.model, records)
        screened = screen(fit, records, list(candidates(fit.model, records, scales)))
        found.append((fit.log_likelihood, fit.model, fit.noise, screened))
    assert found[0] == found[1]
    assert len(found[0][3]) > 10


@pytest.mark.long
def test_a_round_of_the_search_does_not_depend_on_the_number_of_threads(records, monkeypatch):
    start = initial_noise(pack(STAGE), records[:1])
    fit = fit_whole(STAGE, start, records[:1], iterations=20)
    scales = recording_scales(fit.model, records[:1])
    found = []
    for threads in ("1", "4"):
        monkeypatch.setenv(VARIABLE, threads)
        better, explained = explore(fit, STAGE, records[:1], records[1:], scales)
        found.append((better.model, [(e.fit.model, e.gain, e.held_out, e.reconciled) for e in explained]))
    assert found[0] == found[1]
    assert found[0][1][0][0].effects[0].effect == "coulomb_friction"
