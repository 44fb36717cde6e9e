"""Commands that come after a result, to paste."""

from __future__ import annotations

import shlex
from collections.abc import Sequence

ANOTHER = "ANOTHER_RECORDING"
"""Stands for a recording that judges, where the command line named none."""


def diagnose_command(
    model: str,
    estimation: Sequence[str],
    validation: Sequence[str],
    output: str,
    mapping: str | None = None,
) -> str:
    """What says why ``model`` does not follow the recordings: `diagnose`, into ``output``. Without
    ``validation`` the last of several recordings judges, or ANOTHER."""
    bags, judges = list(estimation), list(validation)
    if not judges:
        judges = [bags.pop()] if len(bags) > 1 else [ANOTHER]
    words = ["haptic-teleop", "diagnose", "--model", model, "--estimation", *bags, "--validation", *judges]
    words += ["--mapping", mapping] if mapping else []
    return shlex.join([*words, "--output", output])


def again_command(name: str, argv: Sequence[str], output: str, *more: str) -> str:
    """The same command once more with ``more`` arguments, into ``output``; what ``more`` states anew is not
    stated twice."""
    anew = {"--output", *(word for word in more if word.startswith("--"))}
    words, rest = [], iter(argv)
    for word in rest:
        if word in anew:
            next(rest, None)
        elif word.split("=")[0] not in anew:
            words.append(word)
    return shlex.join(["haptic-teleop", name, *words, *more, "--output", output])
