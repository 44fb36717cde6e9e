"""Pages of the docs as a reader does them: files written, commands run."""

import os
import re
import subprocess
import sys
from pathlib import Path

DOCS = Path(__file__).resolve().parents[2] / "docs"
BLOCK = re.compile(r"^```(?P<language>\w+) ?(?P<file>[\w.]*)\n(?P<text>.*?)^```$", re.MULTILINE | re.DOTALL)


def blocks(page):
    """(language, file, text) of each block of a page that names its language."""
    text = (DOCS / page).read_text(encoding="utf-8")
    return [(m["language"], m["file"], m["text"]) for m in BLOCK.finditer(text)]


def environment():
    """The environment's programs on the PATH, as a user's shell has it."""
    return {**os.environ, "PATH": os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])}


def run(command, folder):
    """The command in the folder; its output."""
    done = subprocess.run(
        ["bash", "-euc", command], cwd=folder, env=environment(), capture_output=True, text=True,
        timeout=200, check=False,
    )  # fmt: skip
    assert done.returncode == 0, f"{command}\n{done.stdout}\n{done.stderr}"
    return done.stdout
