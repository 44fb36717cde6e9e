"""What a command prints beside its tables: single lines, and a report's conclusion as on its page."""

from __future__ import annotations

from rich.console import Console

from .page import Status

WORDS: dict[str, str] = {
    "good": "[green]ok[/green]",
    "fair": "[yellow]note[/yellow]",
    "bad": "[red]bad[/red]",
    "plain": "info",
}


def say(console: Console, text: str) -> None:
    """Print one text as it is: brackets are no markup, numbers take no colour, and a long line stays whole,
    so that a path or a command in it can be copied."""
    console.print(text, markup=False, highlight=False, soft_wrap=True)


def print_conclusion(console: Console, status: Status, happened: str, todo: str, command: str = "") -> None:
    """Print how good it is, what happened, what to do, and the command for that."""
    console.print(f"{WORDS[status]}: ", end="", highlight=False)
    say(console, happened)
    if todo:
        say(console, f"what to do: {todo}")
    if command:
        say(console, f"  {command}")
