"""Prints for each node the functions that were compiled at its start, and those after it has run: JSON lines.

    compiled_while_running.py NODE ...

A process for each, because what is compiled stays compiled; forked, because importing takes longest.
"""

import gc
import json
import os
import sys

import numpy as np
from numba.core.dispatcher import Dispatcher
from ros_graph import Graph, Source

from haptic_teleop_control.compiled import load_numba
from haptic_teleop_control.nodes.base.registry import node_class
from haptic_teleop_control.nodes.streams.joint_states import FIELDS
from haptic_teleop_control.robots import OMNI_JOINTS, SFJ_JOINTS, SFJ_MOTOR_JOINTS

PARAMETERS = {
    "acquisition": {"signal__enabled": True, "signal__duration": 1.0, "signal__step__enabled": True},
    "sfj_driver": {"device": "emulated"},
    "omni_driver": {"device": "emulated", "emulated__docked_time": 0.05},
}
TOPICS = {
    "/sfj/joint_states": SFJ_JOINTS,
    "/omni/joint_states": OMNI_JOINTS,
    "/sfj/effort_command": SFJ_MOTOR_JOINTS,
    "/omni/effort_command": OMNI_JOINTS,
    "/reference": OMNI_JOINTS[1:],
}


def compiled() -> list[str]:
    """Functions with the number of their signatures, whether compiled just now or read from the cache."""
    functions = [item for item in gc.get_objects() if isinstance(item, Dispatcher) and item.overloads]
    return sorted(f"{one.__module__}.{one.__name__} {len(one.overloads)}" for one in functions)


def run(name: str) -> None:
    graph = Graph()
    kind = node_class(name)
    before: list[str] = []

    class Watched(kind):
        def start(self) -> None:
            before.extend(compiled())
            super().start()

    sources = {topic: Source(graph, topic, joints) for topic, joints in TOPICS.items()}
    node = graph.start(Watched, **PARAMETERS.get(name, {}))
    taken = [sources[end.topic_name] for end in node.subscriptions if end.topic_name in sources]
    graph.until(lambda: all(source.connected() for source in taken))
    for k in range(60):  # at 500 Hz
        for topic, source in sources.items():
            values = np.full(len(source.names), 1e-3 * k)
            fields = {"/reference": ("position",), "command": ("effort",), "states": FIELDS}
            chosen = next(names for end, names in fields.items() if topic.endswith(end))
            source.send(**dict.fromkeys(chosen, values))
        graph.run(0.002)
    print(json.dumps([name, before, compiled()]), flush=True)
    graph.close()


if __name__ == "__main__":
    load_numba()
    for name in sys.argv[1:]:
        node_class(name)
    for name in sys.argv[1:]:
        child = os.fork()
        if not child:
            run(name)
            os._exit(0)
        os.waitpid(child, 0)
