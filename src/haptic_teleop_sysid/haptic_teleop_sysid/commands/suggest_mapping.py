"""`import --suggest`: a mapping to look through, for a log whose headers leave something open."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

from rich.console import Console

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_sysid.logs.mapping import Mapping
from haptic_teleop_sysid.logs.proposal_text import mapping_text
from haptic_teleop_sysid.logs.reading import ReadOptions, read_log
from haptic_teleop_sysid.logs.second_look import mend, reverse_braking, tried
from haptic_teleop_sysid.logs.suggest import propose
from haptic_teleop_sysid.report.terminal import say


def suggest(files: list[Path], options: ReadOptions, mapping: Mapping | None) -> int:
    """Print the mapping that a log suggests, and how sure each entry is; returns the exit status.

    Raises ConfigurationError for several ``files``, where a ``mapping`` is given, or where the log lacks what
    no mapping can add.
    """
    if len(files) != 1:
        raise ConfigurationError(f"--suggest looks at one log, and {len(files)} are given: name one.")
    if mapping is not None:
        raise ConfigurationError("--suggest proposes a mapping, and one is given: leave out --mapping.")
    log = read_log(files[0], options)
    proposal = propose(log)
    refused, odd = tried(log, proposal)
    mended = bool(refused) and mend(log, proposal)
    turned = reverse_braking(log, proposal)
    again, odd = tried(log, proposal) if mended or turned else (refused, odd)
    notes = (*log.remarks, *proposal.notes, *odd)
    print(mapping_text(log, proposal, again, notes), end="")
    screen = Console(stderr=True)
    for remark in notes:
        say(screen, f"note: {remark}")
    for doubt in proposal.doubts:
        say(screen, f"open: {doubt.text}")
    every = [c.sure for signals in proposal.joints.values() for c in signals.values()]
    every += [proposal.time.sure] if proposal.time else []
    counted = Counter(every)
    told = ", ".join(f"{counted[s]} {s}" for s in ("stated", "likely", "guessed", "missing") if counted[s])
    verdict = "look through what is not stated" if proposal.open else "nothing is open: no mapping is needed"
    if again:
        verdict = f"not to be imported as it stands: {again}"
    elif mended:
        verdict = (
            f"look through what is not stated: by the headers alone it is refused ({refused.rstrip('.')})"
        )
    elif turned:
        verdict = "look through what is not stated: by the headers alone the input brakes the joint"
    say(screen, f"{told or 'nothing was found'}: {verdict}")
    if proposal.lacking:
        raise ConfigurationError(f"{files[0]}: {proposal.lacking[0]}.")
    return 0
