"""Coordinator, participant, schedule and pace of simulated time, one question at a time."""

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.simulated_time.coordinator import Coordinator
from haptic_teleop_control.simulated_time.messages import (
    ANSWERER,
    HALTED,
    LINK,
    OVER,
    PAUSED,
    PLANT,
    RECORDER,
    RUNNING,
    SOURCE,
    WAITING,
    WITHDRAWN,
    Delivery,
    Member,
    Report,
    Status,
    Tick,
    decode,
    encode,
)
from haptic_teleop_control.simulated_time.pace import Pace
from haptic_teleop_control.simulated_time.participant import Participant
from haptic_teleop_control.simulated_time.schedule import Schedule
from haptic_teleop_control.simulated_time.stamps import ORIGIN, sample_stamp


def joined(coordinator, *members, wall=0.0, sender="", run=""):
    """The coordinator to which `members` have shown that they hear its ticks."""
    for member in members:
        coordinator.hear(Report(member.name, "join", member=member, sender=sender, run=run), wall)
        heard = Report(member.name, "done", what=coordinator.session, sender=sender, run=run)
        coordinator.hear(heard, wall)
    return coordinator


PLANT_MEMBER = Member("/sfj/sfj_sim", PLANT, 500.0, "/sfj/joint_states", "/sfj/effort_command")


def open_loop(**options):
    return joined(Coordinator(["sfj_sim"], 0.0, **options), PLANT_MEMBER)


def listening(faults, refusals=None, say=lambda report: None, **options):
    """A participant that has not joined yet."""
    return Participant(
        PLANT_MEMBER, say, lambda tick, repeated: None, faults.append,
        [].append if refusals is None else refusals.append, **options,
    )  # fmt: skip


def taken_part(participant, session="one", state=RUNNING, reason=""):
    """A coordinator's word that `participant` has joined."""
    name, sender = participant.member.name, participant.sender
    participant.hear(Status(session, state, ORIGIN, (name,), reason, senders=(sender,)))
    return participant


def ticks(messages):
    return [message for message in messages if isinstance(message, Tick)]


def test_time_begins_when_all_have_joined_and_says_whom_it_waits_for():
    coordinator = Coordinator(["sfj_sim", "recorder"], 0.0)
    joined(coordinator, PLANT_MEMBER)
    (status,) = coordinator.poll(0.0)
    assert status.state == "waiting" and "recorder" in status.reason and "use_sim_time" in status.reason
    joined(coordinator, Member("/recorder", RECORDER, topics=("/sfj/joint_states",)))
    assert [tick.stamp for tick in ticks(coordinator.poll(0.01))] == [ORIGIN]


def test_time_does_not_begin_before_everybody_hears_its_ticks_however_long_that_takes():
    # The middleware finds each topic by itself: one had heard every status, and none of the ticks for 5 s.
    coordinator = Coordinator(["sfj_sim"], 0.0)
    sent = []
    participant = listening([], say=sent.append)
    for turn in range(1000):
        wall = 0.01 * turn
        said = [*coordinator.poll(wall)]
        participant.poll(wall)
        for message in said:
            if isinstance(message, Status):
                participant.hear(message)
        while sent:
            coordinator.hear(sent.pop(0), wall)
    assert participant.joined and coordinator.state == WAITING and not coordinator.ticks
    assert participant.waits_for == "/sfj/sfj_sim to hear ticks"
    while not coordinator.ticks:
        wall += 0.01
        assert wall < 11.0
        for message in coordinator.poll(wall):
            participant.hear(message)
        while sent:
            coordinator.hear(sent.pop(0), wall)
    assert coordinator.state == RUNNING and participant.tick.stamp == ORIGIN


def test_who_hears_another_coordinators_ticks_has_not_heard_this_ones():
    coordinator = Coordinator(["sfj_sim"], 0.0)
    coordinator.hear(Report(PLANT_MEMBER.name, "join", member=PLANT_MEMBER), 0.0)
    coordinator.hear(Report(PLANT_MEMBER.name, "done", what="another"), 0.0)
    assert not coordinator.poll(0.1)[-1].number and coordinator.state == WAITING


def test_a_node_that_died_before_it_heard_a_tick_may_be_started_again():
    coordinator = Coordinator(["sfj_sim"], 0.0, liveness=1.0)
    coordinator.hear(Report(PLANT_MEMBER.name, "join", member=PLANT_MEMBER, sender="dead"), 0.0)
    joined(coordinator, PLANT_MEMBER, wall=0.1, sender="again")
    assert "another node of this name" in coordinator.status().refused["again"]
    for turn in range(2, 15):
        coordinator.poll(0.1 * turn)
    joined(coordinator, PLANT_MEMBER, wall=1.5, sender="again")
    assert ticks(coordinator.poll(1.6))[-1].number == 1 and coordinator.state == RUNNING


def test_a_recorder_hears_no_ticks_and_is_not_waited_for():
    recorder = Member("/recorder", RECORDER, topics=("/sfj/joint_states",))
    coordinator = open_loop()
    coordinator.hear(Report("/recorder", "join", member=recorder), 0.0)
    assert ticks(coordinator.poll(0.0))


def test_two_who_misunderstand_each_other_do_not_wait_for_ever():
    answerer = Member("/controller", ANSWERER, topics=("/sfj/joint_states",))
    coordinator = joined(Coordinator(["sfj_sim", "controller"], 0.0), PLANT_MEMBER, answerer)
    wall = 0.0
    while coordinator.state != HALTED:
        wall += 0.01
        assert wall < 60.0
        coordinator.poll(wall)
        coordinator.hear(Report("/sfj/sfj_sim", "waiting", 1, "answer"), wall)
        coordinator.hear(Report("/controller", "done", 1), wall)
    assert wall > 5.0 and "/sfj/sfj_sim waits for answer" in coordinator.reason


def test_without_a_plant_time_does_not_begin_and_says_why():
    answerer = Member("/controller", ANSWERER, topics=("/sfj/joint_states",))
    coordinator = joined(Coordinator(["controller"], 0.0, duration=1.0), answerer)
    coordinator.poll(0.0)
    assert coordinator.state == HALTED and "put a plant" in coordinator.reason


def test_what_joins_late_or_doubles_another_is_refused_with_the_reason():
    coordinator = open_loop()
    coordinator.poll(0.0)
    joined(coordinator, Member("/omni/omni_sim", PLANT, 1000.0, "/omni/joint_states"), sender="late")
    assert "runs already" in coordinator.status().refused["late"]
    other = replace(PLANT_MEMBER, name="/mujoco_sim")
    waiting = joined(joined(Coordinator(["sfj_sim", "x"]), PLANT_MEMBER), other, sender="second")
    assert "/sfj/joint_states" in waiting.status().refused["second"]
    waiting = joined(joined(Coordinator(["sfj_sim", "x"]), PLANT_MEMBER), PLANT_MEMBER, sender="second")
    assert "another node of this name" in waiting.status().refused["second"]


def test_a_refused_participant_is_told_once_and_has_no_fault_of_what_follows():
    faults, refusals = [], []
    participant = listening(faults, refusals)
    for state in (RUNNING, RUNNING, HALTED):
        participant.hear(Status("s", state, ORIGIN, (), "", {participant.sender: "too late"}))
    assert len(refusals) == 1 and "too late" in refusals[0] and not faults


@pytest.mark.parametrize("state", [RUNNING, OVER, HALTED])
def test_what_a_second_coordinator_announces_changes_nothing(state):
    faults, heard = [], []
    participant = taken_part(listening(faults, on_status=heard.append))
    participant.hear(Tick("two", 1, ORIGIN + 5, ("/sfj/sfj_sim",)))
    participant.hear(Status("two", state, ORIGIN + 5, ("/sfj/sfj_sim",), "it was stopped", senders=("x",)))
    assert not faults and len(heard) == 1 and participant.stamp == ORIGIN and participant.tick is None


def test_the_end_of_a_node_of_the_same_name_is_not_the_end_of_the_one_that_takes_part():
    coordinator = open_loop()
    coordinator.poll(0.0)
    joined(coordinator, PLANT_MEMBER, sender="stray")
    coordinator.hear(Report("/sfj/sfj_sim", "done", 1, sender="stray"), 0.0)
    coordinator.hear(Report("/sfj/sfj_sim", "left", sender="stray"), 0.0)
    assert coordinator.state == RUNNING and coordinator.status().members == ("/sfj/sfj_sim",)
    assert not ticks(coordinator.poll(0.0)), "the stray's answer has been taken for the participant's"


def test_two_runs_of_one_file_in_one_domain_do_not_hear_each_other():
    faults = []
    first, second = (Coordinator(["sfj_sim"], 0.0, run=run) for run in ("first", "second"))
    for node, run in ((listening(faults, run="first"), "first"), (listening(faults, run="second"), "second")):
        for coordinator in (second, first):
            joined(coordinator, PLANT_MEMBER, sender=node.sender, run=run)
            node.hear(coordinator.status())
        assert node.joined
        if run == "first":
            first_node = node
    assert first.status().senders == (first_node.sender,) and first.status().refused == {}
    first_node.hear(second.end("the coordinator was stopped"))
    second.hear(Report("/sfj/sfj_sim", "left", sender=second.status().senders[0], run="second"), 0.0)
    assert not faults and first_node.state == WAITING


def test_a_node_started_by_hand_does_not_take_the_place_of_a_scenarios_own():
    coordinator = Coordinator(["sfj_sim", "recorder"], 0.0, run="this")
    joined(coordinator, PLANT_MEMBER, sender="stray")
    assert coordinator.status().members == () and "another node" in coordinator.status().refused["stray"]
    spectator = Member("/spectator", RECORDER, topics=("/sfj/joint_states",))
    joined(coordinator, spectator, sender="hand")
    assert coordinator.status().members == ("/spectator",)


def test_a_coordinator_started_by_hand_takes_nobody_before_it_has_looked_for_another():
    coordinator = joined(Coordinator(["sfj_sim"], 0.0, listens=0.95), PLANT_MEMBER)
    for tenth in range(1, 12):
        coordinator.poll(tenth / 10)
        joined(coordinator, PLANT_MEMBER, wall=tenth / 10)
        assert (coordinator.status().members == ()) == (tenth < 10)


def test_whoever_joined_a_coordinator_that_gives_way_turns_to_the_other_one():
    """It would wait for a coordinator that has ended, and take no refusal of the one that goes on."""
    said, faults, refusals = [], [], []
    stray = Coordinator(["sfj_sim", "omni_sim"], 0.0, born=2)
    scenarios = Coordinator(["sfj_sim"], 0.0, run="of the scenario", born=1)
    joined(scenarios, PLANT_MEMBER, sender="its own", run="of the scenario")
    participant = listening(faults, refusals, said.append)
    participant.poll(0.0)
    stray.hear(said.pop(), 0.0)
    status = stray.poll(0.0)[0]
    participant.hear(status)
    assert participant.joined and stray.yields_to(scenarios.status())
    participant.hear(stray.give_way())
    assert not participant.joined and not stray.poll(0.3)[1:] and stray.end("").state == WITHDRAWN
    participant.poll(0.1)
    scenarios.hear(said.pop(), 0.1)
    participant.hear(scenarios.status())
    assert "another node of this name" in refusals[0] and not faults


@pytest.mark.parametrize(("state", "joins_again"), [(WAITING, True), (RUNNING, False), (PAUSED, False)])
def test_a_coordinator_that_is_lost_before_time_began_leaves_its_participants_free(state, joins_again):
    said, faults = [], []
    participant = taken_part(listening(faults, say=said.append, liveness=1.0), state=state)
    for tenth in range(14):
        participant.poll(tenth / 10)
    assert participant.joined != joins_again and bool(faults) != joins_again
    assert said[-1].act == ("join" if joins_again else "left")
    taken_part(participant, session="another", state=WAITING)
    assert participant.state == (WAITING if joins_again else state), "it hears the other, or its own alone"


def test_of_two_coordinators_whose_time_has_begun_the_later_one_halts():
    first, second = open_loop(born=1), open_loop(born=2)
    first.poll(0.0), second.poll(0.0)
    assert second.yields_to(first.status()) and not first.yields_to(second.status())
    assert second.give_way().state == HALTED and "was there first" in second.status().reason
    assert not second.yields_to(first.status()) and not first.yields_to(second.end(""))


def test_pause_holds_time_a_step_is_one_tick_and_a_step_while_running_is_refused():
    coordinator = open_loop()
    assert len(ticks(coordinator.poll(0.0))) == 1
    assert "pause it" in coordinator.step()
    coordinator.hear(Report("/sfj/sfj_sim", "done", 1), 0.01)
    assert coordinator.pause() is None
    assert coordinator.pause() is not None
    assert not ticks(coordinator.poll(0.02)) and coordinator.state == PAUSED
    assert coordinator.step() is None
    assert "not over" in coordinator.step()
    (tick,) = ticks(coordinator.poll(0.03))
    assert tick.stamp == ORIGIN + 2_000_000
    coordinator.hear(Report("/sfj/sfj_sim", "done", 2), 0.04)
    assert not ticks(coordinator.poll(0.05))
    assert coordinator.resume() is None
    assert len(ticks(coordinator.poll(0.06))) == 1
    assert coordinator.resume() is not None


def test_a_pause_accuses_nobody():
    coordinator = open_loop()
    coordinator.poll(0.0)
    coordinator.hear(Report("/sfj/sfj_sim", "done", 1), 0.0)
    coordinator.pause()
    for k in range(1000):
        coordinator.poll(0.05 * k)
    assert coordinator.state == PAUSED


@pytest.mark.parametrize(("others", "lead"), [((), 600), ((ANSWERER,), 300), ((ANSWERER, LINK), 150)])
def test_time_stays_300_samples_from_what_a_recorder_has_kept_and_ends_only_when_it_has_all(others, lead):
    """Of the topics together: states, and what answers them, and what that sends into a link. lead: ms."""
    lead *= 1_000_000
    topics = ("/sfj/joint_states",)
    coordinator = joined(
        Coordinator(["sfj_sim"], 0.0, duration=3.0),
        PLANT_MEMBER,
        Member("/recorder", RECORDER, topics=topics),
        *(Member(f"/{kind}", kind, topics=topics if kind == ANSWERER else ("/way",)) for kind in others),
    )
    wall = 0.0

    def run_on():
        nonlocal wall
        for _ in range(5000):
            wall += 1e-4
            for tick in ticks(coordinator.poll(wall)):
                coordinator.hear(Report("/sfj/sfj_sim", "done", tick.number), wall)

    def keep(stamp):
        coordinator.hear(Report("/recorder", "recorded", stamps={"/sfj/joint_states": stamp}), wall)

    run_on()
    assert coordinator.stamp == ORIGIN + lead - 2_000_000  # nothing is kept yet, not even the first
    keep(ORIGIN + 900_000_000)
    run_on()
    assert coordinator.stamp == ORIGIN + 900_000_000 + lead
    keep(ORIGIN + 2_900_000_000)
    run_on()
    assert coordinator.stamp == sample_stamp(1499, 500.0) and coordinator.state == RUNNING
    keep(sample_stamp(1499, 500.0))
    run_on()
    assert coordinator.state == OVER and coordinator.stamp == ORIGIN + 3_000_000_000


def test_a_participant_that_ends_halts_time_but_a_recorder_may_go():
    recorder = Member("/recorder", RECORDER, topics=("/sfj/joint_states",))
    coordinator = joined(open_loop(), recorder)
    coordinator.poll(0.0)
    coordinator.hear(Report("/recorder", "left"), 0.0)
    assert coordinator.state == RUNNING
    coordinator.hear(Report("/sfj/sfj_sim", "left"), 0.0)
    assert coordinator.state == HALTED and "/sfj/sfj_sim has ended" in coordinator.reason


def test_a_plant_that_has_nothing_to_publish_is_not_waited_for_with_an_answer():
    members = [
        Member("/a", PLANT, 1000.0, "/one", silent=True),
        Member("/b", PLANT, 1000.0, "/two"),
        Member("/c", ANSWERER, topics=("/one", "/two")),
    ]
    schedule = Schedule(members)
    first = schedule.grant()
    assert set(first.due) == {"/a", "/b"} and first.states == ("/two",)
    assert schedule.last_stamps() == {"/two": ORIGIN}
    schedule.silence("/a", False)
    assert schedule.grant().states == ("/one", "/two")


def test_with_a_link_coinciding_states_go_singly_and_packets_come_in_order_of_arrival():
    members = [
        Member("/a", PLANT, 1000.0, "/one"),
        Member("/b", PLANT, 500.0, "/two"),
        Member("/c", ANSWERER, topics=("/one", "/two"), linked=True),
        Member("/link", LINK, topics=("/to_b", "/to_a")),
    ]
    schedule = Schedule(members, 0.01)
    assert schedule.grant().states == ("/one",)
    schedule.under_way("/to_b", ORIGIN, [ORIGIN, ORIGIN + 1_500_000])  # at once, and a copy later
    second = schedule.grant()
    assert second.states == ("/two",) and second.deliveries == (Delivery("/to_b", ORIGIN, ORIGIN),)
    schedule.under_way("/to_a", ORIGIN, [ORIGIN + 1_500_000])
    third, fourth = schedule.grant(), schedule.grant()
    assert (third.stamp, third.deliveries) == (ORIGIN + 1_000_000, ())
    assert [delivery.way for delivery in fourth.deliveries] == ["/to_b", "/to_a"]


@pytest.mark.parametrize("factor", [-1.0, float("nan"), float("inf")])
def test_a_real_time_factor_that_is_none_is_refused(factor):
    with pytest.raises(ConfigurationError, match="real_time_factor"):
        Pace(factor)
    with pytest.raises(ConfigurationError, match="real_time_factor"):
        Coordinator([], factor)


def test_time_never_runs_ahead_of_the_wall_and_what_is_late_stays_late():
    pace = Pace(2.0)
    assert pace.wait(10.0, 0.0) == 0.0
    assert pace.wait(10.0, 0.5) == pytest.approx(0.25)
    assert pace.wait(10.25, 0.5) == 0.0
    assert pace.wait(11.25, 0.5) == 0.0  # a second late: only a little of that is made up
    assert pace.wait(11.25, 1.0) > 0.2


def test_the_factor_achieved_leaves_pauses_out():
    pace = Pace(0.0)
    pace.advanced(0.0, 0.0)
    pace.advanced(1.0, 3.0)
    pace.stop()
    pace.advanced(100.0, 3.0)
    pace.advanced(101.0, 4.0)
    assert pace.achieved == pytest.approx(2.0)


@pytest.mark.parametrize("text", ["", "nonsense", "[]", "{}", '{"type": "tick"}', '{"type": "report"}'])
def test_what_is_no_message_is_none(text):
    assert decode(text) is None


@given(st.text())
def test_any_text_is_a_message_or_none(text):
    assert decode(text) is None


def test_a_coordinator_that_begins_anew_is_told_from_a_second_one():
    faults = []
    participant = taken_part(listening(faults))
    participant.hear(Status("one", OVER, ORIGIN, ("/sfj/sfj_sim",), "the coordinator was stopped"))
    participant.hear(Status("two", WAITING, ORIGIN))
    assert len(faults) == 1 and "start this node anew" in faults[0]


def test_what_cannot_be_paused_yet_says_what_it_waits_for():
    coordinator = Coordinator(["sfj_sim"])
    for refused in (coordinator.pause(), coordinator.resume(), coordinator.step()):
        assert refused is not None and "waiting for sfj_sim" in refused


@pytest.mark.parametrize(
    "text",
    [
        '{"type":"report","name":"/a","act":"recorded","number":0,"what":"","stamps":null,"arrivals":[],'
        '"member":null,"silent":false,"sender":"","run":""}',
        '{"type":"status","session":"s","state":"running","stamp":1,"members":[],"reason":"","refused":[],'
        '"achieved":1.0,"senders":[],"run":""}',
        encode(Status("s", "dreaming", 1)),
        encode(Report("/a", "join", member=Member("/a", PLANT, 0.0, "/t"))),
        encode(Report("/a", "join", member=Member("/a", SOURCE, float("nan"), "/t"))),
        encode(Report("/a", "join", member=Member("/a", "guest"))),
    ],
)
def test_what_is_nearly_a_message_is_none(text):
    assert decode(text) is None


def test_a_packet_of_a_way_that_nobody_has_is_left_out():
    coordinator = joined(open_loop(), Member("/link", LINK, topics=("/way",)))
    coordinator.poll(0.0)
    coordinator.hear(Report("/link", "taken", stamps={"/elsewhere": ORIGIN}, arrivals=(ORIGIN,)), 0.0)
    assert coordinator.state == RUNNING


def test_a_participant_in_a_fault_says_so_and_is_not_accused_of_silence():
    said = []
    participant = taken_part(listening([], say=said.append))
    for wall in range(200):
        participant.poll(0.1 * wall)
    assert said[-1].act == "left" and "silent" in said[-1].what
    coordinator = joined(Coordinator(["sfj_sim"], 0.0), PLANT_MEMBER, sender=participant.sender)
    coordinator.poll(0.0)
    coordinator.hear(said[-1], 0.0)
    assert coordinator.state == HALTED and "takes no part any more" in coordinator.reason


def test_a_recorder_that_keeps_nothing_does_not_hold_time_for_ever():
    recorder = Member("/recorder", RECORDER, topics=("/sfj/joint_states",))
    coordinator = joined(Coordinator(["sfj_sim"], 0.0), PLANT_MEMBER, recorder)
    wall = 0.0
    while coordinator.state != HALTED:
        wall += 0.01
        assert wall < 300.0
        for tick in ticks(coordinator.poll(wall)):
            coordinator.hear(Report("/sfj/sfj_sim", "done", tick.number), wall)
        coordinator.hear(Report("/recorder", "recorded", stamps={}), wall)
    assert "not recorded" in coordinator.reason
