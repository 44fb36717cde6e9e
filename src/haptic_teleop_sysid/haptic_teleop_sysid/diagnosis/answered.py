"""The verdict on what is left of the names; and for what has no name a model, its place, or an encoder that
reads wrong."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.estimation.fit import Fit

from .believed import Believed, Say
from .decision.name_tests.place import at_its_place, at_the_map, beside_findings
from .decision.search.freely_fitted import re_estimated
from .decision.search.rounds import SearchResult
from .decision.unknown.at_reversals import Turning, where_torque_jumps, with_friction
from .decision.unknown.at_the_actuator import at_the_actuator, drawn_over_the_input
from .decision.unknown.beside_unknown import with_names
from .decision.unknown.drive_friction import with_drive_friction
from .decision.unknown.encoder_error import WrongReading, read_wrong
from .decision.unknown.simulating_model import with_the_named
from .decision.unknown.stand_in import StandIn, stand_in
from .decision.verdict import Verdict, decide_verdict
from .evidence.acting_place import ActingPlace
from .evidence.measured_map import MeasuredMap, no_torque
from .evidence.other_forms import spread_by_form, together
from .examined import Examined, drawn_beside


@dataclass(frozen=True)
class Answered:
    """``verdict``, and ``result`` with the final model, which simulates; ``turning``: torques that jump where
    the motion turns; ``acting``: the parity equations, beside the findings. ``bare``: the fit with the names
    alone. Of what has no name: ``mapped``, the torque that is drawn for it, or why none is; ``instead``, a
    stand-in that is not believed; ``misread``, the encoder whose reading is wrong, and ``wrong``, over the
    angle, where that is known; ``of_input``, what quantities gain as what it is a share of;
    ``beside_names``: whether the map is drawn beside what is named with it."""

    verdict: Verdict
    result: SearchResult
    turning: Turning
    acting: ActingPlace | None
    bare: Fit
    mapped: MeasuredMap | None = None
    instead: StandIn | None = None
    misread: str | None = None
    wrong: WrongReading | None = None
    of_input: Mapping[str, float] | None = None
    beside_names: bool = False

    @property
    def unknown(self) -> bool:
        return self.verdict.kind == "unknown"

    @property
    def stands_in(self) -> bool:
        """Whether the final model has something for what has no name; of an answer whose structure was not
        fitted again since."""
        return self.result.final is not self.bare

    @property
    def added(self) -> str:
        """What the augmented model has, in words."""
        if self.instead is not None:
            named_too = self.instead.named(self.verdict.findings)
            return "what is named, as it simulates best" if named_too else "a stand-in that is not believed"
        if self.mapped is None or self.mapped.fit is None:
            return "what was found"
        if self.beside_names or self.result.choices:
            return "what was found, and a measured torque for the rest"
        return "a measured torque in place of a name"


def answered(belief: Believed, left: Examined, say: Say) -> Answered:
    """The verdict, step by step; ``left``: what is left of the names in a ``belief``."""
    found, result = belief.found, left.result
    kinds = found.learn, found.judge
    spread = together(belief.stand.spread, left.forms)
    verdict = decide_verdict(result, *kinds, left.doubt, spread, left.adequate)
    turning = where_torque_jumps(result.baseline, *kinds, found.inertias)
    first = Answered(verdict, result, turning, left.acting, result.final)
    steps = _Steps(belief, left, say)
    answer = steps.modelled(first)
    answer = steps.with_frictions(answer)
    answer = steps.where_equations_say(answer)
    answer = steps.read_right(answer)
    answer = steps.beside_the_named(answer)
    return steps.where_a_map_says(answer)


@dataclass(frozen=True)
class _Steps:
    """What an answer goes through; ``belief`` and ``left``: see `answered`."""

    belief: Believed
    left: Examined
    say: Say

    @property
    def predicted(self) -> SearchResult:
        """The names with the fits by prediction."""
        return self.left.result

    def modelled(self, answer: Answered) -> Answered:
        """With a map or a stand-in for what has no name, and with the names that are told beside it."""
        if not answer.unknown:
            return answer
        found, doubt = self.belief.found, self.left.doubt
        # Before a map, which is held against it.
        result = re_estimated(answer.result, found.given, found.resized, found.errors)
        mapped, instead = drawn_beside(found, result, self.say), None
        if mapped.fit is None:
            instead = stand_in(result.final, found.given, doubt, found.errors)
        verdict = with_names(
            answer.verdict,
            self.predicted,
            doubt,
            instead,
            found.second_method,
            found.learn,
            self._spread,
            answer.turning,
        )
        final = (mapped.fit if instead is None else instead.fit) or result.final
        bare, result = result.final, replace(result, final=final)
        return replace(answer, verdict=verdict, result=result, bare=bare, mapped=mapped, instead=instead)

    def _spread(self, model: Model) -> dict[str, float]:
        found = self.belief.found
        return together(self.belief.stand.spread, spread_by_form(model, found.learn, found.cutoff))

    def with_frictions(self, answer: Answered) -> Answered:
        """With dry friction that parity equations or reversals show beside it."""
        found, verdict, turning = self.belief.found, answer.verdict, answer.turning
        if answer.acting is not None and verdict.kind != "no_mismatch":
            kinds = found.learn, found.judge
            verdict = with_drive_friction(verdict, answer.acting, kinds, self.predicted.baseline, turning)
        return replace(answer, verdict=with_friction(verdict, turning, self.predicted, found.learn))

    def where_equations_say(self, answer: Answered) -> Answered:
        """At the place where parity equations say that it acts."""
        if answer.acting is None or answer.verdict.kind == "no_mismatch":
            return answer
        acting, doubt = beside_findings(answer.verdict, answer.acting), self.left.doubt
        answer = replace(answer, acting=acting)
        # What acts now and then, or follows the input in detail, is little beside the noise of equations.
        if self._placed:
            return answer
        given_up = None
        # What was refuted at its own place says nothing for that.
        if doubt is not None and doubt is not self.left.away and doubt.choice is not None:
            given_up = doubt.choice.chosen.effect
        verdict, misread = at_its_place(answer.verdict, acting, given_up)
        return replace(answer, verdict=verdict, misread=misread)

    @property
    def _placed(self) -> bool:
        """Whether the doubt says where something is."""
        return self.left.doubt is not None and self.left.doubt.place is not None

    def read_right(self, answer: Answered) -> Answered:
        """Without a torque where an encoder reads wrong."""
        found = self.belief.found
        kinds = found.learn, found.judge
        verdict, wrong = read_wrong(
            answer.verdict, self.predicted.baseline, kinds, found.cutoff, found.course, found.count
        )
        misread = answer.misread if wrong is None else wrong.error.location
        answer = replace(answer, verdict=verdict, wrong=wrong, misread=misread)
        if misread is None:
            return answer
        mapped = no_torque(misread, wrong and wrong.error)
        return replace(
            answer, mapped=mapped, instead=None, result=replace(answer.result, final=answer.bare)
        )

    def beside_the_named(self, answer: Answered) -> Answered:
        """With the torques that are named beside something unknown, where that simulates better."""
        if not answer.unknown:
            return answer
        found, result = self.belief.found, answer.result
        no_map = answer.mapped if answer.misread is not None else None
        parts = found.given, found.learn, found.errors, found.resized
        beside = with_the_named(
            answer.verdict,
            answer.bare,
            result.final,
            *parts,
            lambda fit: no_map or drawn_beside(found, replace(result, final=fit), self.say),
        )
        if beside is None:
            return answer
        result = replace(result, final=beside.fit)
        return replace(answer, mapped=beside.mapped, instead=None, result=result, beside_names=True)

    def where_a_map_says(self, answer: Answered) -> Answered:
        """At the place of its map, or at the actuator where it is the input's: a torque that is drawn over
        the motion is the motion's."""
        if answer.misread is not None:
            return answer
        found, verdict, mapped = self.belief.found, answer.verdict, answer.mapped
        asked = self.predicted.baseline, found.learn, found.judge, found.cutoff
        if mapped is None or mapped.fit is None:
            verdict, of_input = at_the_actuator(verdict, *asked)
            return replace(answer, verdict=verdict, of_input=of_input)
        if not self._placed:
            verdict = at_the_map(verdict, mapped, answer.acting)
        return replace(answer, verdict=drawn_over_the_input(verdict, mapped, *asked))
