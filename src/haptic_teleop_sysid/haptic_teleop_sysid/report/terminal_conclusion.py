"""A report's first line on the terminal: the same words as on its page."""

from __future__ import annotations

from rich.console import Console

from .page import Status

WORDS: dict[str, str] = {
    "good": "[green]ok[/green]",
    "fair": "[yellow]note[/yellow]",
    "bad": "[red]bad[/red]",
    "plain": "info",
}


def print_conclusion(console: Console, status: Status, happened: str, todo: str, command: str = "") -> None:
    """Print how good it is, what happened, what to do, and the command for that; lines are not broken, so
    that the command can be copied."""
    console.print(f"{WORDS[status]}: ", end="", highlight=False)
    console.print(happened, markup=False, highlight=False, soft_wrap=True)
    if todo:
        console.print(f"what to do: {todo}", markup=False, highlight=False, soft_wrap=True)
    if command:
        console.print(f"  {command}", markup=False, highlight=False, soft_wrap=True)
