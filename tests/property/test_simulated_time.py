"""The protocol of simulated time over a network that loses, repeats, delays and overtakes messages.

The participants here are toys: what they do is told by a list of what was done, which has to be the list of a
world without a network. No ROS, no clock: the wall is a number that the test counts up.
"""

import heapq
import json
import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from haptic_teleop_control.simulated_time.coordinator import Coordinator
from haptic_teleop_control.simulated_time.messages import (
    ANSWERER,
    HALTED,
    KINDS,
    OVER,
    PLANT,
    SOURCE,
    STATES,
    Delivery,
    Member,
    Report,
    Status,
    Tick,
    decode,
    encode,
)
from haptic_teleop_control.simulated_time.participant import Participant
from haptic_teleop_control.simulated_time.stamps import sample_count, sample_stamp

STEP = 0.01  # s of wall between two turns of the world
DEAD = float("inf")


class World:
    """Everybody, and the wires between them. A message takes its time, is lost, or comes twice."""

    def __init__(self, seed, loss=0.0, duration=0.05, rates=(1000.0, 500.0, 400.0), **options):
        self.luck, self.loss = random.Random(seed), loss
        self.wall, self.order = 0.0, 0
        self.wires = []
        self.stopped = {}  # name -> wall until which it does not run
        self.done = []
        fast, slow, source = rates
        self.coordinator = Coordinator(
            ["omni_sim", "sfj_sim", "generator", "controller"], factor=0.0, duration=duration, **options
        )
        self.nodes = {
            node.name: node
            for node in (
                ToyPlant(self, "/omni/omni_sim", fast, "/omni/joint_states"),
                ToyPlant(self, "/sfj/sfj_sim", slow, "/sfj/joint_states"),
                ToySource(self, "/generator", source),
                ToyController(self, "/controller"),
            )
        }

    def send(self, target, message):
        copies = 1 + (self.luck.random() < self.loss)
        for _ in range(copies):
            if self.luck.random() >= self.loss:
                self.order += 1
                delay = self.luck.random() * 3 * STEP if self.loss else 0.0
                heapq.heappush(self.wires, (self.wall + delay, self.order, target, message))

    def run(self, until=None):
        """To the end, or until a condition holds."""
        for _ in range(20_000):
            if until is not None and until():
                return self
            self.wall += STEP
            if self.awake("coordinator"):
                for message in self.coordinator.poll(self.wall):
                    assert decode(encode(message)) == message
                    for name in self.nodes:
                        self.send(name, message)
            for name, node in self.nodes.items():
                if self.awake(name):
                    node.participant.poll(self.wall)
            held = []
            while self.wires and self.wires[0][0] <= self.wall:
                entry = heapq.heappop(self.wires)
                if not self.awake(entry[2]):
                    if self.stopped.get(entry[2]) != DEAD:
                        held.append(entry)
                elif entry[2] == "coordinator":
                    self.coordinator.hear(entry[3], self.wall)
                else:
                    self.nodes[entry[2]].hear(entry[3])
            for entry in held:
                heapq.heappush(self.wires, entry)
            if self.coordinator.state in (OVER, HALTED) and not self.wires:
                return self
        raise AssertionError("it does not come to an end")

    def awake(self, name):
        return self.stopped.get(name, 0.0) <= self.wall


class Toy:
    def __init__(self, world, member):
        self.world, self.name = world, member.name
        self.faults = []
        say = lambda report: world.send("coordinator", report)  # noqa: E731
        self.participant = Participant(member, say, self.on_tick, self.faults.append, self.faults.append)

    def hear(self, message):
        if isinstance(message, (Tick, Status)):
            self.participant.hear(message)
        else:
            self.take(*message)


class ToyPlant(Toy):
    def __init__(self, world, name, rate, topic):
        self.topic, self.sampled, self.awaiting = topic, 0, False
        super().__init__(world, Member(name, PLANT, rate, topic, "/commands"))

    def on_tick(self, tick, repeated):
        if self.name not in tick.due:
            return
        if tick.stamp == self.sampled and not self.awaiting:
            self.participant.done()
            return
        self.sampled, self.awaiting = tick.stamp, True
        if repeated:
            self.participant.waiting("answer")
        self.world.send("/controller", (self.topic, tick.stamp))

    def take(self, topic, stamp):
        if self.awaiting and stamp == self.sampled:
            self.awaiting = False
            self.world.done.append((stamp, f"step {self.topic}"))
            self.participant.done()


class ToySource(Toy):
    def __init__(self, world, name, rate):
        self.sampled = 0
        super().__init__(world, Member(name, SOURCE, rate, "/reference"))

    def on_tick(self, tick, repeated):
        if self.name in tick.due:
            self.sampled = tick.stamp
            self.participant.done()
        if self.sampled:
            self.world.send("/controller", ("/reference", self.sampled))


class ToyController(Toy):
    def __init__(self, world, name):
        self.states, self.reference, self.tick, self.answered = {}, 0, None, {}
        topics = ("/omni/joint_states", "/sfj/joint_states")
        super().__init__(world, Member(name, ANSWERER, topics=topics))

    def on_tick(self, tick, repeated):
        self.tick = tick
        self.advance()
        if repeated:
            self.participant.done()

    def take(self, topic, stamp):
        if topic == "/reference":
            self.reference = max(self.reference, stamp)
        else:
            self.states[topic] = max(stamp, self.states.get(topic, 0))
            if self.answered.get(topic) == stamp:
                self.reply(topic, stamp)
        self.advance()

    def advance(self):
        for topic in self.participant.member.topics:
            tick = self.tick
            if tick is None or topic not in tick.states or self.answered.get(topic) == tick.stamp:
                continue
            if self.states.get(topic) != tick.stamp or self.reference < tick.newest.get("/reference", 0):
                return
            self.answered[topic] = tick.stamp
            self.world.done.append((tick.stamp, f"answer {topic} with {self.reference}"))
            self.reply(topic, tick.stamp)

    def reply(self, topic, stamp):
        plant = "/omni/omni_sim" if topic.startswith("/omni") else "/sfj/sfj_sim"
        self.world.send(plant, (topic, stamp))


def answers(world):
    return [entry for entry in world.done if entry[1].startswith("answer")]


def steps(world, topic):
    return [stamp for stamp, what in world.done if what == f"step {topic}"]


@settings(max_examples=25)
@given(seed=st.integers(0, 10**6), loss=st.floats(0.0, 0.4), rates=st.sampled_from([
    (1000.0, 500.0, 500.0), (1000.0, 500.0, 400.0), (300.0, 700.0, 90.0),
]))  # fmt: skip
def test_whatever_the_network_does_the_same_happens_in_the_same_order(seed, loss, rates):
    rough, smooth = World(seed, loss, rates=rates).run(), World(0, rates=rates).run()
    assert rough.coordinator.state == OVER
    assert answers(rough) == answers(smooth)
    for topic, rate in (("/omni/joint_states", rates[0]), ("/sfj/joint_states", rates[1])):
        expected = [sample_stamp(k, rate) for k in range(sample_count(rate, 0.05))]
        assert steps(rough, topic) == steps(smooth, topic) == expected
    assert not any(node.faults for node in rough.nodes.values())


def test_every_answer_knows_the_newest_reference_that_is_not_from_the_future():
    world = World(0, rates=(1000.0, 500.0, 400.0)).run()
    references = [sample_stamp(k, 400.0) for k in range(20)]
    for stamp, what in answers(world):
        assert int(what.rsplit(" ", 1)[1]) == max(r for r in references if r <= stamp)


def test_where_states_coincide_the_first_in_the_answerers_list_is_answered_first():
    at = {}
    for stamp, what in answers(World(3, 0.3).run()):
        at.setdefault(stamp, []).append(what.split()[1])
    coinciding = [topics for topics in at.values() if len(topics) == 2]
    assert len(coinciding) == 25
    assert all(topics == ["/omni/joint_states", "/sfj/joint_states"] for topics in coinciding)


@settings(max_examples=25)
@given(seed=st.integers(0, 10**6), name=st.sampled_from(
    ["/omni/omni_sim", "/sfj/sfj_sim", "/generator", "/controller", "coordinator"]
), begin=st.floats(0.0, 1.0), length=st.floats(0.0, 1.8))  # fmt: skip
def test_a_process_that_stands_still_for_less_than_the_bound_changes_nothing(seed, name, begin, length):
    world = World(seed, 0.05)
    original = world.awake
    world.awake = lambda who: original(who) and not (who == name and begin <= world.wall < begin + length)
    world.run()
    assert world.coordinator.state == OVER
    assert answers(world) == answers(World(0).run())


def test_a_machine_that_stands_still_accuses_nobody():
    world = World(1)
    world.run(until=lambda: world.coordinator.ticks == 10)
    world.wall += 3600.0
    world.run()
    assert world.coordinator.state == OVER and not any(node.faults for node in world.nodes.values())


@pytest.mark.parametrize(
    ("dead", "named"),
    [("/controller", "the answer to the state"), ("/generator", "its sample on /reference"),
     ("/sfj/sfj_sim", "its state on /sfj/joint_states")],
)  # fmt: skip
def test_who_owes_something_for_too_long_halts_time_and_is_named(dead, named):
    world = World(2)
    world.run(until=lambda: world.coordinator.ticks == 10)
    world.stopped[dead] = DEAD
    world.run()
    assert world.coordinator.state == HALTED
    assert dead in world.coordinator.reason and named in world.coordinator.reason
    others = [node for name, node in world.nodes.items() if name != dead]
    assert all(len(node.faults) == 1 and dead in node.faults[0] for node in others)


def test_a_coordinator_that_dies_is_a_fault_of_every_participant():
    world = World(4)
    world.run(until=lambda: world.coordinator.ticks == 10)
    world.stopped["coordinator"] = DEAD
    world.run(until=lambda: all(node.faults for node in world.nodes.values()))
    said = [node.faults[0] for node in world.nodes.values()]
    assert all("coordinator" in fault and "silent" in fault for fault in said)


# What anybody may publish on these topics.

NAMES, STAMPS = st.text(st.characters(codec="utf-8"), max_size=8), st.integers(0, 2**31 * 10**9 - 1)
TUPLES, NEWEST = st.lists(NAMES, max_size=3).map(tuple), st.dictionaries(NAMES, STAMPS, max_size=3)
DELIVERIES = st.lists(st.builds(Delivery, NAMES, STAMPS, STAMPS), max_size=2).map(tuple)
MEMBERS = st.builds(
    lambda kind, rate, **rest: Member(kind=kind, rate=rate if kind in (PLANT, SOURCE) else 0.0, **rest),
    kind=st.sampled_from(KINDS), rate=st.floats(1e-3, 1e5), name=NAMES, topic=NAMES, commands=NAMES,
    topics=TUPLES, linked=st.booleans(), silent=st.booleans(),
)  # fmt: skip
MESSAGES = st.one_of(
    st.builds(Tick, NAMES, STAMPS, STAMPS, TUPLES, TUPLES, NEWEST, DELIVERIES),
    st.builds(
        Status, NAMES, st.sampled_from(STATES), STAMPS, TUPLES, NAMES,
        st.dictionaries(NAMES, NAMES, max_size=3), st.floats(0, 1e9), TUPLES, NAMES, STAMPS,
    ),
    st.builds(
        Report, NAMES, st.sampled_from(["join", "done", "waiting", "recorded", "taken", "left"]), STAMPS,
        NAMES, NEWEST, st.lists(STAMPS, max_size=2).map(tuple), st.none() | MEMBERS, st.booleans(), NAMES,
        NAMES,
    ),
)  # fmt: skip
ODD = st.one_of(
    st.none(), st.booleans(), st.integers(), st.integers(min_value=2**62), st.floats(), st.text(),
    st.just("\ud800"), st.lists(st.none() | st.floats() | st.text() | st.lists(st.integers()), max_size=3),
    st.dictionaries(st.text(), st.none() | st.floats() | st.text(), max_size=3),
)  # fmt: skip
ODD_TEXTS = [
    "1e999", "-1e999", "Infinity", "NaN", "1" + "0" * 400, "1" * 5000, "[" * 100_000, '{"a":' * 50_000,
]  # fmt: skip


def poisoned(message, data):
    """The text of a message in which one field, maybe within its member, is something else."""
    content = json.loads(encode(message))
    inner = content["member"] if content.get("member") and data.draw(st.booleans()) else content
    key = data.draw(st.sampled_from(sorted(inner)))
    if data.draw(st.booleans()):
        inner[key] = data.draw(ODD)
        return json.dumps(content)
    inner[key] = "@@"
    return json.dumps(content).replace('"@@"', data.draw(st.sampled_from(ODD_TEXTS)))


def assert_harmless(text):
    """What is taken for a message can be told again, and neither coordinator nor participant fails by it."""
    message = decode(text)
    if message is None:
        return
    assert decode(encode(message)) == message
    if isinstance(message, Report):
        coordinator = Coordinator([])
        for wall in (0.0, 0.1, 1.0, 1.1):
            coordinator.hear(message, wall)
            for said in coordinator.poll(wall):
                assert encode(said)
        return
    participant = Participant(
        Member("/n", ANSWERER), lambda _: None, lambda *_: None, lambda _: None, lambda _: None
    )
    participant.poll(0.0)
    participant.hear(message)
    participant.poll(0.1)


@settings(max_examples=200, deadline=None)
@given(message=MESSAGES)
def test_every_message_is_what_it_was_after_the_way(message):
    assert decode(encode(message)) == message


@settings(max_examples=400, deadline=None)
@given(data=st.data())
def test_a_message_with_anything_in_a_field_is_none_or_does_no_harm(data):
    assert_harmless(poisoned(data.draw(MESSAGES), data))


@settings(max_examples=200, deadline=None)
@given(text=st.text() | st.recursive(ODD, lambda inner: st.lists(inner, max_size=3)).map(json.dumps))
def test_any_text_is_a_message_or_none(text):
    assert_harmless(text)


@pytest.mark.parametrize("wrong", ODD_TEXTS)
def test_numbers_without_end_depth_without_end_and_endless_text_are_no_messages(wrong):
    whole = encode(Status("s", "running", 777, achieved=0.5, born=1))
    for right in ("777", "0.5", '"running"'):
        assert right in whole and decode(whole.replace(right, wrong)) is None
    assert decode(wrong) is None
    assert decode(whole.replace("running", "r" * 300_000)) is None
