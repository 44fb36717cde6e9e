"""Reference pages made from the code at every build: nodes, faults, effects, commands, modules.

They are written into docs/generated, which is no part of the repository.
"""

import contextlib
import importlib
import io
import os
import re
from pathlib import Path

import yaml
from effects_page import effects_page

CONTROL, SIM, SYSID = "haptic_teleop_control", "haptic_teleop_sim", "haptic_teleop_sysid"
SFJ, OMNI = "haptic_teleop_2dsfj", "haptic_teleop_omni"
API = {
    "Robots, parameters, signals": {
        CONTROL: "robots parameters parameter_files quantities faults errors filters signals.settings "
        "signals.generator",
    },
    "Force laws and teleoperation": {
        CONTROL: "laws.contract laws.stage_law laws.augmented_error laws.disturbance_observer "
        "laws.master_side laws.omni_slave laws.sfj_master teleoperation.coupling teleoperation.machine "
        "teleoperation.passivity teleoperation.link_model",
    },
    "Recordings": {
        CONTROL: "recording.series recording.reader recording.quality recording.writer",
    },
    "Simulation": {
        SIM: "model plant plant_bank kernel.simulate effects.entry effects.parameter effects.registry "
        "sfj_robot omni_robot operators experiments lockstep emulation mujoco_robot",
    },
    "Identification": {
        SYSID: "recordings.dataset recordings.channels recordings.time_grid logs.mapping simulation.windows "
        "simulation.fit simulation.parameter_fit estimation.residuals runs.comparison diagnosis.run "
        "verification.run verification.overlay report.page",
    },
    "Drivers": {CONTROL: "device", SFJ: "driver settings build", OMNI: "driver settings build"},
}
"""Modules of the programming interface by chapter and package; the rest is the inside."""


def write_pages(app):
    """Make docs/generated anew, but leave a file alone whose text is the same: Sphinx then builds only what
    changed."""
    folder = Path(app.srcdir) / "generated"
    os.environ["COLUMNS"] = "88"  # of `--help`
    folder.mkdir(exist_ok=True)
    pages = node_pages() | {
        "faults.md": faults_page(),
        "effects.md": effects_page(folder),
        "commands.md": commands_page(),
    }
    pages |= api_pages()
    for path in folder.rglob("*.md"):
        if str(path.relative_to(folder)) not in pages:
            path.unlink()
    for name, text in pages.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")


def nodes():
    """All nodes, the recorder too: name of the executable -> class."""
    from haptic_teleop_control.nodes.base.registry import node_class, node_names
    from haptic_teleop_control.nodes.recorder import NODE

    return {**{name: node_class(name) for name in node_names()}, "recorder": NODE}


def faults():
    """(name, sentence) of every fault -> the nodes that report it."""
    from haptic_teleop_control.nodes.timing.time_base import TIME_FAULTS

    found = {}
    for name, node in nodes().items():
        simulated = TIME_FAULTS if node.MAY_BE_SIMULATED else {}
        for fault in {**node.FAULTS, **simulated}.items():
            found.setdefault(fault, []).append(name)
    return found


SIMULATED = "in simulated time [`simulated_time`](../faults.md)"
NODE_PAGE = """\
# {name}

`{full}`: {summary}.

To start it alone: `haptic-teleop {name}`, or `ros2 run {package} {name}`.

## Topics and services

```text
{topics}
```

## Parameters

Below each meaning stands what is allowed. *Live*: `haptic-teleop set` or `ros2 param set` may change it while
the node runs.

{table}

## Faults

{faults}
"""


def node_pages():
    """A page for each node from what it states of itself, and their list."""
    pages, lines = {}, []
    for name, node in sorted(nodes().items()):
        table = parameter_table(node.TABLE)
        told = ", ".join(f"[`{fault}`](../faults.md)" for fault in node.FAULTS)
        pages[f"nodes/{name}.md"] = NODE_PAGE.format(
            name=name,
            full="/".join(["", *([node.NAMESPACE] if node.NAMESPACE else []), node.NAME]),
            summary=node.SUMMARY,
            package=node.__module__.partition(".")[0],
            topics="\n".join([*node.TOPICS, *([""] if node.NOTES else []), *node.NOTES]),
            table=table,
            faults=told if name == "time_coordinator" else ", ".join(filter(None, [told, SIMULATED])),
        )
        lines.append(f"| [{name}](nodes/{name}.md) | {node.SUMMARY} |")
    pages["nodes.md"] = "\n".join(
        [
            "# Nodes\n\nEach page is made from the table that the node itself declares and checks.\n",
            "| node | does |\n|---|---|",
            *lines,
            "",
            toctree(f"nodes/{name}" for name in sorted(nodes())),
        ]
    )
    return pages


def parameter_table(parameters):
    """Name and default in a first column, meaning and range in a second: both fit a page."""
    rows = ["| parameter | meaning |", "|---|---|"]
    for p in parameters:
        unit = p.unit.replace("*", "·").replace("^2", "²").replace("^3", "³")
        default = "required" if p.required else f"default `{yaml_text(p.default)}` {unit}".strip()
        facts = [*([in_words(p.limits())] if p.limits() else []), *(["live"] if p.runtime else [])]
        told = f"<br>*{'; '.join(facts)}*" if facts else ""
        meaning = p.meaning.replace("<", "&lt;").replace(">", "&gt;")
        rows.append(f"| `{p.name}`<br>{default} | {meaning}{told} |")
    return "\n".join(rows)


def yaml_text(value):
    """A default as one writes it in a parameter file."""
    return yaml.safe_dump(value, default_flow_style=True, width=10**6).removesuffix("\n...\n").strip()


def in_words(limits):
    """A range in words, which cannot be taken for HTML: `above 0, to 1` for `0 < value <= 1`; choices with
    `or`."""
    return _RANGE.sub(_range_in_words, limits.replace(" | ", " or ")).replace("_", "\\_")


_RANGE = re.compile(r"(?:(\S+) (<=?) )?\bvalue\b(?: (<=?) (\S+))?$")


def _range_in_words(found):
    lowest, at_least, at_most, highest = found.groups()
    if at_least == at_most == "<=":
        return f"{lowest} to {highest}"
    words = [f"{'from' if at_least == '<=' else 'above'} {lowest}"] if lowest else []
    words += [f"{'to' if at_most == '<=' else 'below'} {highest}"] if highest else []
    return ", ".join(words) or found[0]


def toctree(names):
    """A list of pages that the sidebar shows."""
    return "\n".join(["```{toctree}", ":hidden:", "", *names, "```", ""])


FAULTS_PAGE = """\
# Faults

A node that finds a fault counts it, sets its output to zero (force_controller: at once that of the master,
after most faults over `ramp_out_time` that of the slave), and latches until reset: `haptic-teleop operate
reset --controller NODE`, such as `/sfj/sfj_driver`. The first fault counts as the cause; those after it are
usually consequences. The fault stands in the node's `/diagnostics` and in the recording, and `haptic-teleop
verify` begins with it.

| fault, reported by | what happened | what to do |
|---|---|---|
{rows}
"""


def faults_page():
    """Every fault with its cause, its remedy, and who reports it."""
    rows = []
    for (fault, sentence), who in sorted(faults().items()):
        cause, _, remedy = sentence.partition("; ")
        linked = ", ".join(f"[{name}](nodes/{name}.md)" for name in who)
        rows.append(f"| `{fault}`<br>{linked} | {cause} | {remedy} |")
    return FAULTS_PAGE.format(rows="\n".join(rows))


COMMANDS_LEAD = """\
# Commands

What `haptic-teleop NAME --help` says. Nodes have [pages of their own](nodes.md). Exit statuses of all:

| exit status | means |
|---|---|
| 0 | success; also a scenario or a node that you end with Ctrl-C |
| 1 | a run ended in a fault, `verify` found a failure, a node refused what `set` or `operate` asked, one of \
several logs was not imported, or the program has a defect |
| 2 | a mistake that the message explains |
| 3 | `recover`: something was lost; `trend --check`: a recording is not as it should be |
| 130 | ended with Ctrl-C before there was a result |

Completion, in the start-up file of the shell: `eval "$(haptic-teleop --completion bash)"`; for zsh the same
after `compinit`; for fish `haptic-teleop --completion fish | source`.

| command | does |
|---|---|
{rows}
"""
COMMAND_ORDER = (SYSID, SIM, CONTROL, SFJ, OMNI)
"""Packages in the order in which a reader needs their commands."""


def commands_page():
    """A list of the executables that are no nodes, and what `--help` says of each."""
    from haptic_teleop_control.front_door import load, registries

    rows, text = [], []
    its_nodes = nodes()
    listed = registries()
    for package in sorted(listed, key=COMMAND_ORDER.index):
        for name, (_, meaning) in listed[package].items():
            if name in its_nodes:
                continue
            said = io.StringIO()
            with contextlib.redirect_stdout(said), contextlib.suppress(SystemExit):
                load(name)(["--help"])
            does = f"{meaning[0].upper()}{meaning[1:]}."
            rows.append(f"| [`{name}`](#{name}) | {does} |")
            with_ros = f"With ROS: `ros2 run {package} {name}`."
            text.append(f"## {name}\n\n{does} {with_ros}\n\n```text\n{said.getvalue().rstrip()}\n```\n")
    return "\n".join([COMMANDS_LEAD.format(rows="\n".join(rows)), *text])


API_PAGE = """\
# {name}

```{{eval-rst}}
.. automodule:: {module}
```
"""
API_LEAD = """\
# Programming interface

What scripts of your own may call. Arrays over time are `(time, signal)` in SI units, angles are positive
counter-clockwise, times are s from the start of a recording, stamps are int64 ns.
"""


def api_pages():
    """A page for each module of the programming interface, and their list by chapters."""
    pages, chapters = {}, [API_LEAD]
    for chapter, packages in API.items():
        lines, names = [], []
        for package, modules in packages.items():
            for short in modules.split():
                module = f"{package}.{short}"
                first = (importlib.import_module(module).__doc__ or "").strip().partition("\n\n")[0]
                pages[f"api/{module}.md"] = API_PAGE.format(name=short, module=module)
                lines.append(f"| [{module}](api/{module}.md) | {' '.join(first.split())} |")
                names.append(f"api/{module}")
        chapters += [f"## {chapter}\n", "| module | holds |\n|---|---|", *lines, "", toctree(names)]
    return {**pages, "api.md": "\n".join(chapters)}


def setup(app):
    app.connect("builder-inited", write_pages)
    return {"parallel_read_safe": True}
