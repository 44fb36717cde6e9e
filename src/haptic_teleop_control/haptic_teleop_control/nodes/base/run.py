"""Running nodes: one executable's command line, the executor's loop, and an end that leaves the outputs at
zero."""

from __future__ import annotations

import gc
import sys
import time
import warnings
from collections.abc import Callable, Sequence
from contextlib import nullcontext

import rclpy
from rclpy.duration import Duration
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor

from haptic_teleop_control.command_line import run_command, tell
from haptic_teleop_control.errors import ConfigurationError, HapticTeleopError
from haptic_teleop_control.forced_exit import ends_within
from haptic_teleop_control.nodes.base.haptic_node import HapticNode
from haptic_teleop_control.nodes.base.node_help import node_help
from haptic_teleop_control.nodes.base.parameters import overrides
from haptic_teleop_control.nodes.base.ros_arguments import RosArguments, parse_ros_arguments
from haptic_teleop_control.nodes.launching.arming import ArmedStart
from haptic_teleop_control.nodes.launching.parent import OPTION, ParentChannel
from haptic_teleop_control.nodes.launching.stopping import StopRequests, stop_requests
from haptic_teleop_control.nodes.streams.senders import SENDERS_TOLD, UNTOLD
from haptic_teleop_control.nodes.timing.deadline import request_realtime
from haptic_teleop_control.parameter_files import load_parameter_file
from haptic_teleop_control.teleoperation.agreement import simulates
from haptic_teleop_control.warning_list import REALTIME_REFUSED

POLL = 0.05
"""Seconds after which the loop looks whether it has been asked to end; a signal does not wake the
executor."""

BURST = 32
"""Turns of the executor between two looks whether the context still lives, which cost a tenth of a turn."""

START_POLL = 0.01
"""The same while the start is awaited: processes that start together shall do so within two states."""

LEAVING = 5.0
"""Seconds that the middleware is given to leave the graph: fewer than a parent waits for the process."""

LAST_WORDS = 2.0
"""Seconds that the last samples are given to arrive; a recorder that was killed never takes them."""

COORDINATOR_GONE = "the coordinator of simulated time has gone"

SWITCH_INTERVAL = 5e-4
"""Seconds after which a thread that waits for the interpreter gets it: Python's 5 ms are five periods of 1
kHz."""


def run_node(node_class: type[HapticNode], argv: Sequence[str] | None = None) -> int:
    """The `main` of a node's executable: exit status 0 after SIGINT or SIGTERM, 2 for a refused parameter."""
    return run_command(lambda arguments: _run([node_class], arguments), argv)


def run_nodes(node_classes: Sequence[type[HapticNode]], argv: Sequence[str]) -> int:
    """Several nodes in this process with one executor and the same `--ros-args`. Raises
    ConfigurationError."""
    return _run(node_classes, argv)


def create_nodes(node_classes: Sequence[type[HapticNode]], arguments: RosArguments) -> list[HapticNode]:
    """The nodes with their parameters from `arguments`, all checked before the first is made: also that they
    run in one time, because those that wait for a coordinator would wait for good beside others."""
    options = []
    for node_class in node_classes:
        neighbours = [other.TABLE for other in node_classes if other is not node_class]
        full_name = arguments.full_name(node_class.NAME, node_class.NAMESPACE)
        options.append(overrides(node_class.TABLE, full_name, arguments, neighbours))
    if len(node_classes) > 1:
        times = {
            node_class.NAME: {"use_sim_time": any(p.name == "use_sim_time" and p.value for p in given)}
            for node_class, given in zip(node_classes, options, strict=True)
            if node_class.MAY_BE_SIMULATED
        }
        simulates(times, "nodes of one process")
    nodes: list[HapticNode] = []
    try:
        for node_class, given in zip(node_classes, options, strict=True):
            nodes.append(node_class(parameter_overrides=given))
    except BaseException:
        stop_nodes(nodes)
        raise
    return nodes


def quiet_nodes(nodes: Sequence[HapticNode]) -> None:
    """Zero output from every node, the last one made first, whatever happens to one of them."""
    for node in reversed(nodes):
        try:
            node.shutdown_safely()
        except Exception as failure:
            node.get_logger().error(f"while stopping: {failure}")


def stop_nodes(nodes: Sequence[HapticNode]) -> None:
    """Zero output, then the end of every node."""
    quiet_nodes(nodes)
    for node in reversed(nodes):
        node.destroy_node()


def heard_by_all(nodes: Sequence[HapticNode]) -> None:
    """Waits, for LAST_WORDS at most, until everything has arrived that was said in simulated time, where
    nothing may be lost: a publisher that is destroyed takes back what is still on its way."""
    until = time.monotonic() + LAST_WORDS
    for node in nodes:
        for publisher in node.publishers if node.time.simulated else ():
            publisher.wait_for_all_acked(Duration(seconds=max(0.0, until - time.monotonic())))


def make_executor(context: rclpy.Context | None = None) -> rclpy.executors.Executor:
    """The events executor, which holds 1 kHz in Python, or the single-threaded one where it does not
    exist."""
    # Who asked has gone, or has not been found yet and asks again: no news for the node's terminal.
    warnings.filterwarnings("ignore", "failed to send response", RuntimeWarning)
    try:
        from rclpy.experimental import EventsExecutor
    except ImportError:
        return SingleThreadedExecutor(context=context)
    return EventsExecutor(context=context)


def read_arguments(argv: Sequence[str]) -> tuple[list[str], RosArguments, ArmedStart | None]:
    """The arguments for rclpy, all but the parameters; what they say; and the start to wait for if
    `parent.OPTION` is among them.

    Raises ConfigurationError, also for a parameter file.
    """
    rest = [argument for argument in argv if argument != OPTION]
    arguments = parse_ros_arguments(rest)
    if arguments.other:
        raise ConfigurationError(f"{arguments.other[0]} is not an argument of a node; see --help.")
    for file in arguments.parameter_files:
        load_parameter_file(file)
    armed = ArmedStart(ParentChannel.to_parent()) if len(rest) < len(argv) else None
    return arguments.for_rcl, arguments, armed


def spin(
    nodes: Sequence[HapticNode],
    should_stop: Callable[[], bool],
    realtime_priority: int = 0,
    may_start: Callable[[], bool] = lambda: True,
    cut_short: Callable[[], bool] = lambda: False,
) -> None:
    """Starts `nodes` as soon as they may, runs their callbacks until `should_stop()`, leaves their outputs at
    zero; raises what a node's thread failed with. cut_short: whether simulated time ended without an end,
    which is asked once, in the end."""
    executor = make_executor()
    for node in nodes:
        executor.add_node(node)
    gc.collect()
    gc.freeze()
    # Not earlier: loading and collecting would keep other real-time processes waiting.
    if realtime_priority and not request_realtime(realtime_priority):
        for node in nodes:
            node.warnings.state("real time", REALTIME_REFUSED)
    if not SENDERS_TOLD:
        nodes[0].get_logger().warning(UNTOLD)
    failed = None
    try:
        while not may_start():
            if should_stop() or not rclpy.ok():
                return
            executor.spin_once(timeout_sec=START_POLL)
        for node in nodes:
            node.start()
        while rclpy.ok() and not should_stop() and failed is None:
            failed = _burst(executor, nodes, should_stop)
    except ExternalShutdownException:
        pass
    finally:
        # That nobody has said that time is over would not tell: it may still be on its way.
        if cut_short():
            for node in nodes:
                if node.time.simulated:
                    node.on_time_fault(COORDINATOR_GONE)
        quiet_nodes(nodes)  # before the executor, whose end takes a while
        for node in nodes:
            executor.remove_node(node)
        executor.shutdown()
        # Here, and not when an error that refers to this frame is forgotten: then its nodes have gone.
        del executor
    if failed is not None:
        raise failed


def _burst(
    executor: rclpy.executors.Executor, nodes: Sequence[HapticNode], should_stop: Callable[[], bool]
) -> BaseException | None:
    """Some turns of the executor, fewer where something has ended; what a node's thread failed with."""
    for _ in range(BURST):
        # EventsExecutor.spin() keeps a core busy and delivers nothing in some builds; spin_once does not.
        executor.spin_once(timeout_sec=POLL)
        for node in nodes:
            if node.failure is not None:
                return node.failure
        if should_stop():
            break
    return None


def _run(node_classes: Sequence[type[HapticNode]], argv: Sequence[str]) -> int:
    if any(argument in ("-h", "--help") for argument in argv):
        print("\n\n".join(node_help(node_class) for node_class in node_classes))
        return 0
    argv, arguments, armed = read_arguments(argv)
    sys.setswitchinterval(SWITCH_INTERVAL)
    with stop_requests() as stop:
        try:
            rclpy.init(args=list(argv), signal_handler_options=rclpy.signals.SignalHandlerOptions.NO)
        except Exception as refusal:  # rcl names the argument, but its exception type is not public
            raise ConfigurationError(
                f"--ros-args: {str(refusal).splitlines()[0]}; see `--help`."
            ) from refusal
        try:
            telling = nullcontext() if armed is None else armed.telling_compilation()
            with stop.interruptible(), telling:
                nodes = create_nodes(node_classes, arguments)
            status = 1
            try:
                priority = max(node.values.get("realtime_priority", 0) for node in nodes)
                if armed is None:
                    spin(nodes, stop.is_set, priority)
                else:
                    armed.ready(lambda: nodes)
                    ends = lambda: stop.is_set() or armed.abandoned  # noqa: E731
                    spin(nodes, ends, priority, armed.begin, armed.cut_short)
                status = 0
            except HapticTeleopError as refusal:
                status = tell(refusal)  # at once: what the middleware does while it leaves must not cost it
            finally:
                with ends_within(LEAVING, status):
                    heard_by_all(nodes)
                    for node in reversed(nodes):
                        node.destroy_node()
                    rclpy.try_shutdown()
            return status
        except StopRequests.Interrupt:
            pass
        finally:
            rclpy.try_shutdown()
    return 0
