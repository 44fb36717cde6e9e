"""What the page of the blind benchmark says first, and what was said instead of what was hidden."""

from typing import Any

import pytest

from haptic_teleop_sysid.blind.page import blind_page
from haptic_teleop_sysid.blind.summary import summarise
from haptic_teleop_sysid.blind.tables import WORDS, confusion_table


def result_of(met: dict[str, str], failed: tuple[str, ...] = (), ran: int = 4) -> dict[str, Any]:
    """blind.json of four cases; ``met``: of a target, "must" for all others."""
    summary = summarise([])
    for key, entry in summary["targets"].items():
        entry |= {"met": met.get(key, "must"), "rate": 0.5, "value": 0.5, "hits": 1, "of": 2}
    summary["failed"] = list(failed)
    told = {"seed": 1, "version": "1", "digest": "ab", "cases": [], "summary": summary}
    return told | {"cases_run": ran, "cases_asked": {"single": 4}}


@pytest.mark.parametrize(
    ("result", "status", "told"),
    [
        (result_of({}), "good", "All 14 targets are met."),
        (result_of({"detected": "aim"}), "good", "All 14 targets are met; 1 of them reach what is aimed at."),
        (result_of({"detected": "no data"}), "good", "All 13 targets that there are data for are met."),
        (result_of(dict.fromkeys(WORDS, "no data")), "fair", "No target can be judged"),
        (result_of({"detected": "missed"}), "bad", "1 of 14 targets missed: effects detected."),
        (result_of({}, ("case0001: no",)), "bad", "1 of 4 diagnoses failed, which counts as wrong; even so"),
        (result_of({"detected": "missed"}, ("case0001: no",)), "bad", "1 of 14 targets missed"),
    ],
)
def test_the_first_line_says_what_came_of_the_targets(result: dict[str, Any], status: str, told: str) -> None:
    page = blind_page(result)
    assert page.conclusion is not None
    assert page.conclusion[0] == status and page.conclusion[1].startswith(told)


def test_what_the_first_line_leaves_out_stands_below_it() -> None:
    page = blind_page(result_of({"detected": "missed", "set_size": "no data"}, ("case0001: no",), ran=3))
    assert [status for status, _ in page.verdicts] == ["bad", "plain", "fair", "plain"]
    told = " ".join(text for _, text in page.verdicts)
    for part in ("1 of 3 diagnoses failed", "mean size of the stated set", "Only 3 of 4 cases", "SHA-256 ab"):
        assert part in told


def test_what_was_said_instead_leaves_out_who_was_always_right_and_begins_with_the_worst() -> None:
    confusion = {
        "backlash": {"backlash": 3, "unknown": 1},
        "gravity": {"gravity": 2},
        "none": {"no_mismatch": 9, "backlash": 2},
        "detent": {"unknown": 2},
        "cubic_drag": {"quadratic_drag": 2, "gravity": 1},
    }
    _, rows = confusion_table(confusion, {"detent", "cubic_drag"})
    assert rows == [
        ("cubic drag", "0/3", "quadratic drag 2, gravity 1"),
        ("nothing", "9/11", "backlash 2"),
        ("backlash", "3/4", "unknown 1"),
    ]
