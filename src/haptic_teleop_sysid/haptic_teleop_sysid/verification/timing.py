"""The graph's health from stamps, and the recorder's count: rates, missing samples, loop latency."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_control.recording.quality import bag_problems
from haptic_teleop_sysid.verification.clock import Clock
from haptic_teleop_sysid.verification.signals import COMMAND_TOPIC, MASTER_TOPIC, STATE_TOPIC

if TYPE_CHECKING:
    from haptic_teleop_control.recording import JointStateSeries, Recording

NS = 1e-9
PAIRS_OF_TOPICS = ((STATE_TOPIC, COMMAND_TOPIC), (MASTER_TOPIC, "/omni/effort_command"))


@dataclass(frozen=True)
class Latency:
    """Loop latency in s over the answered states of `state_topic`.

    From a state's sampling time to the arrival of its answer at the recorder (`from_stamp`), and from the
    state's own arrival there to the answer's (`between_arrivals`); each as p50, p99, max. `unanswered` states
    had no answer, `late_percent` of the answers took more than two periods. These are None where time is not
    the wall's: an answer takes none there.
    """

    state_topic: str
    command_topic: str
    answered: int
    unanswered: int
    late_percent: float | None
    from_stamp: dict[str, float] | None
    between_arrivals: dict[str, float] | None


def topic_health(series: JointStateSeries, topic: str, on_the_way: int | None = None) -> dict[str, Any]:
    """Return one topic's figures as plain data: messages, rate (Hz), period (s), lost, lost_on_the_way,
    duplicates, backwards, longest_gap (s), jitter_p99 (s) and the sentences about what is wrong (see
    `recording.quality`).

    lost: samples that the recording lacks, by its stamps. Of these `on_the_way` were published and did not
    reach the recorder, if it told (else None); the others were never taken, because the node or its device
    was late. A publisher that leaves its stamps empty is judged by the times of arrival.
    """
    if len(np.unique(series.stamp)) < 3:
        series = replace(series, stamp=series.received)
    quality = bag_problems(series, topic)
    rate = (quality.count - quality.duplicates - 1) / quality.duration if quality.duration > 0.0 else None
    return {
        "messages": quality.count,
        "rate": rate,
        "period": quality.period,
        "lost": quality.lost,
        "lost_on_the_way": on_the_way,
        "duplicates": quality.duplicates,
        "backwards": quality.backwards,
        "longest_gap": quality.longest_gap,
        "jitter_p99": quality.jitter_99,
        "problems": list(quality.problems),
    }


def answers(
    states: JointStateSeries, commands: JointStateSeries
) -> tuple[NDArray[np.float64], NDArray[np.float64], int]:
    """Return latencies from stamp (m,) and between arrivals (m,) in s, and how many states have no answer.

    A command answers the state whose stamp it bears; of several commands to one state the first counts.
    States before the first and after the last command are not asked for: the graph was still starting, or
    already stopping.
    """
    stamps, first_state = np.unique(states.stamp, return_index=True)
    answered, first_command = np.unique(commands.stamp, return_index=True)
    common, at_state, at_command = np.intersect1d(stamps, answered, assume_unique=True, return_indices=True)
    if not len(common):
        return np.zeros(0), np.zeros(0), len(stamps)
    asked = np.sum((stamps >= common[0]) & (stamps <= common[-1]))
    arrival = commands.received[first_command[at_command]]
    from_stamp = (arrival - common).astype(np.float64) * NS
    between = (arrival - states.received[first_state[at_state]]).astype(np.float64) * NS
    return from_stamp, between, int(asked - len(common))


def graph_health(recording: Recording, clock: Clock) -> dict[str, Any]:
    """Return {"topics": {topic: figures}, "latency": [figures of each pair of state and command topic]} as
    plain data. clock: by what time it was made.
    """
    topics = {}
    counted = recording.reception.get("lost_on_the_way", {})
    for name, series in recording.topics.items():
        if len(series) > 2:
            topics[name] = topic_health(series, name, counted.get(name))
    latency, timed = [], clock.of_wall
    for state_topic, command_topic in PAIRS_OF_TOPICS:
        states, commands = recording.topics.get(state_topic), recording.topics.get(command_topic)
        if states is None or commands is None or not len(commands):
            continue
        from_stamp, between, unanswered = answers(states, commands)
        if not len(from_stamp):
            continue
        period = topics[state_topic]["period"] if state_topic in topics else np.inf
        latency.append(
            asdict(
                Latency(
                    state_topic,
                    command_topic,
                    answered=len(from_stamp),
                    unanswered=unanswered,
                    late_percent=100.0 * float(np.mean(from_stamp > 2.0 * period)) if timed else None,
                    from_stamp=_percentiles(from_stamp) if timed else None,
                    between_arrivals=_percentiles(between) if timed else None,
                )
            )
        )
    return {"topics": topics, "latency": latency}


def latency_samples(recording: Recording, clock: Clock) -> NDArray[np.float64]:
    """Return the slave's loop latencies from stamp to arrival, (m,) in s; empty when they cannot be known."""
    states, commands = recording.topics.get(STATE_TOPIC), recording.topics.get(COMMAND_TOPIC)
    if not clock.of_wall or states is None or commands is None or not len(commands):
        return np.zeros(0)
    return answers(states, commands)[0]


def _percentiles(values: NDArray[np.float64]) -> dict[str, float]:
    p50, p99, top = np.percentile(values, [50.0, 99.0, 100.0])
    return {"p50": float(p50), "p99": float(p99), "max": float(top)}
