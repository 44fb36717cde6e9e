"""Docstrings here are plain English with names between backticks, not reStructuredText: this makes them so.

Names become literals, what is indented (equations, layouts, examples) stays as it is laid out, and no other
character means anything.
"""

import inspect
import re

_CODE = re.compile(r"``(.+?)``|`([^`]+)`", re.DOTALL)
_ITEM = re.compile(r"- ")


def to_rst(lines):
    """The lines of a docstring as reStructuredText that reads as they do."""
    text = inspect.cleandoc("\n".join(line.rstrip() for line in lines))
    made = []
    for paragraph in re.split(r"\n\s*\n", text):
        if any(line.startswith((" ", "\t")) for line in paragraph.splitlines()):
            made += _laid_out(paragraph)
        else:
            made += [*_prose(paragraph).splitlines(), ""]
    return made


def _prose(text):
    """Text whose only markup is that names stand between backticks."""
    made, at = [], 0
    for found in _CODE.finditer(text):
        name = " ".join((found[1] or found[2]).split())
        # `name`s: what follows at once would not end the literal.
        made += [_plain(text[at : found.start()]), f"\\ ``{name}``\\ "]
        at = found.end()
    return "".join([*made, _plain(text[at:])])


def _plain(text):
    return re.sub(r"([\\*|_`])", r"\\\1", text).replace("::", ":\\ :")


def _laid_out(paragraph):
    """A paragraph with indented lines: prose up to the first of them, from there as it stands."""
    lines = paragraph.splitlines()
    first = next(i for i, line in enumerate(lines) if line.startswith((" ", "\t")))
    if _ITEM.match(lines[0]):
        first = 0
    made = [*_prose("\n".join(lines[:first])).splitlines(), ""] if first else []
    return [*made, "::", "", *(f"    {line}" for line in lines[first:]), ""]


def _process(app, what, name, obj, options, lines):
    lines[:] = to_rst(lines)


def setup(app):
    app.connect("autodoc-process-docstring", _process)
    return {"parallel_read_safe": True}
