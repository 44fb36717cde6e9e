"""What a model file says of itself: whether it is a user's own model, a re-estimated or an augmented one."""

from __future__ import annotations

from pathlib import Path

#: How a comment above a model names its role, as `report.roles` has it.
_ROLE = "role: "
#: The roles of models that a program wrote, by what a diagnosis calls what it hands on.
_HELD = {"given": "given", "baseline": "re-estimated", "augmented": "augmented"}


def role_comment(held: str) -> str:
    """The comment for a model that is handed on (`given` | `baseline` | `augmented`)."""
    return f"{_ROLE}{_HELD[held]}"


def told_role(path: str | Path) -> str | None:
    """given | re-estimated | augmented, by the comments above a model; None where nothing says so: then it is
    somebody's own."""
    try:
        lines = Path(path).read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError):
        return None
    for line in lines:
        if not line.startswith("#"):
            break
        role = line.lstrip("# ").removeprefix(_ROLE)
        if line.lstrip("# ").startswith(_ROLE) and role in _HELD.values():
            return role
    return None
