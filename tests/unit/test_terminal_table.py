"""Tables on the terminal: whole, and no wider than it is, whatever the names are."""

import io
import re
from pathlib import Path

import pytest
from rich.cells import cell_len
from rich.console import Console

import haptic_teleop_sysid
from haptic_teleop_sysid.report.terminal_table import TerminalTable, wrapped

JOINT = "right_shoulder_abduction_harmonic_drive_joint_with_long_name"
BAGS = [f"recordings/bench_of_the_second_floor_{part}_2026-11-24T09-30-00" for part in ("learn", "check")]
SIGNALS = [f"{JOINT}_{side}\n{what}" for side in ("motor", "arm") for what in ("position", "velocity")]
NUMBERS = ("98.612", "< -1000", "–", "0.0")
TABLE = TerminalTable(("model", *SIGNALS), [[bag, *NUMBERS] for bag in BAGS], SIGNALS, f"{JOINT}: fit in %")


def printed(table, width):
    """Its lines on a terminal of that width."""
    out = io.StringIO()
    Console(file=out, width=width).print(table)
    return out.getvalue().splitlines()


def rows(lines):
    """The cells of each row, put together again from their lines."""
    found = [[]]
    for line in lines:
        cells = [cell.strip() for cell in re.split("[│┃]", line)[1:-1]]
        if cells:
            found[-1].append(cells)
        elif found[-1]:
            found.append([])
    return [["".join(column) for column in zip(*one, strict=True)] for one in found if one]


@pytest.mark.parametrize("width", [120, 80, 60, 50])
def test_long_names_neither_leave_the_terminal_nor_are_cut_nor_run_into_the_next_column(width):
    lines = printed(TABLE, width)
    assert max(map(cell_len, lines)) <= width
    header, *body = rows(lines)
    assert header == ["model", *(signal.replace("\n", "") for signal in SIGNALS)]
    assert body == [[bag, *NUMBERS] for bag in BAGS]
    assert "…" not in "".join(lines)


def test_numbers_are_never_broken():
    lines = printed(TABLE, 50)
    assert all(any(re.search(rf"│ +{re.escape(n)} │", line) for line in lines) for n in NUMBERS)


def test_a_table_with_room_has_a_line_for_each_row():
    lines = printed(
        TerminalTable(("parameter", "estimate"), [("stiffness", "1.2"), ("a_b", "3")], ("estimate",)), 80
    )
    assert len(lines) == 3 + 2 + 1
    assert "│ a_b       │        3 │" in lines


@pytest.mark.parametrize(
    ("text", "width", "lines"),
    [
        ("stage1_motor", 12, ["stage1_motor"]), ("stage1_motor", 8, ["stage1_", "motor"]),
        ("a/b.yaml (fit)", 8, ["a/b.yaml", "(fit)"]), ("abcdefghij", 4, ["abcd", "efgh", "ij"]),
        ("関節の名前", 4, ["関節", "の名", "前"]), ("abcd_ef", 4, ["abcd", "_ef"]), ("", 4, [""]),
    ],
)  # fmt: skip
def test_a_name_is_broken_behind_its_marks_first(text, width, lines):
    assert wrapped(text, width).split("\n") == lines


def test_brackets_in_a_name_are_no_markup():
    assert any(
        "[red]mine[/red]" in line for line in printed(TerminalTable(("file",), [("[red]mine[/red]",)]), 80)
    )


def test_every_table_of_a_command_is_printed_this_way():
    package = Path(haptic_teleop_sysid.__file__).parent
    users = [path.name for path in package.rglob("*.py") if "rich.table" in path.read_text()]
    assert users == ["terminal_table.py"]
