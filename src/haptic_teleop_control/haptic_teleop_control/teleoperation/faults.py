"""The faults of the teleoperation, with the sentences for the log."""

from haptic_teleop_control.faults import SECOND_SENDER, SECOND_SENDER_SENTENCE

NON_FINITE_STATE, MALFORMED_STATE, TIME_JUMP = "non_finite_state", "malformed_state", "time_jump"
STALE_REFERENCE, STALE_MASTER, STALE_SLAVE = "stale_reference", "stale_master", "stale_slave"
STALE_LINK, SLOW_LINK, ROBOT_FAULT = "stale_link", "slow_link", "robot_fault"

FAULTS: dict[str, str] = {
    NON_FINITE_STATE: "a state or reference held a value that is not a finite number; look at its publisher",
    MALFORMED_STATE: "a state or reference had wrong joint names or number of values; look at its publisher",
    TIME_JUMP: "the stamps of a state went back by more than the timeout; look for a second publisher",
    STALE_REFERENCE: "the reference stopped; look whether the signal generator still runs",
    STALE_MASTER: "the master's state stopped; look whether its driver still runs",
    STALE_SLAVE: "the slave's state stopped; look whether its driver still runs",
    STALE_LINK: "nothing comes over the link any more; look at the network between master and slave",
    SLOW_LINK: "the link takes longer than maximum_round_trip; look at the network, or couple without it",
    ROBOT_FAULT: "a robot has a latched fault; see to that first, then reset that node",
    SECOND_SENDER: SECOND_SENDER_SENTENCE,
}
