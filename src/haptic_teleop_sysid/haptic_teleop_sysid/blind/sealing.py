"""The sealed envelope: labels nobody reads before the last diagnosis, and a digest that proves them."""

from __future__ import annotations

import hashlib
import json
import math
import zlib
from pathlib import Path
from typing import Any

from haptic_teleop_control.errors import ConfigurationError

SEALED = "labels.sealed"
DIGEST = "labels.sha256"


def _stream(secret: str, length: int) -> bytes:
    blocks = (length + 31) // 32
    return b"".join(hashlib.sha256(f"{secret}/{i}".encode()).digest() for i in range(blocks))[:length]


def _mix(data: bytes, secret: str) -> bytes:
    return bytes(a ^ b for a, b in zip(data, _stream(secret, len(data)), strict=True))


def seal(labels: dict[str, Any], directory: Path, secret: str) -> str:
    """Write the labels so that they cannot be read by accident; return their SHA-256 digest."""
    plain = json.dumps(labels, sort_keys=True).encode()
    digest = hashlib.sha256(plain).hexdigest()
    (directory / SEALED).write_bytes(_mix(zlib.compress(plain), secret))
    (directory / DIGEST).write_text(digest + "\n")
    return digest


def sealed_digest(directory: Path) -> str | None:
    """Return the digest of the envelope in `directory`, None when there is none."""
    path = directory / DIGEST
    return path.read_text().strip() if path.exists() and (directory / SEALED).exists() else None


def open_labels(
    directory: Path, secret: str, waiting: list[str], digest: str | None = None
) -> dict[str, Any]:
    """Return the labels. `waiting` are cases without a diagnosis: while there are any, the seal stays closed.

    Raises ConfigurationError then, when the secret is another one, or when the content is not what the digest
    (that of the directory, or `digest` noted before) promised.
    """
    if waiting:
        shown = ", ".join(waiting[:3]) + (", ..." if len(waiting) > 3 else "")
        raise ConfigurationError(
            f"{directory / SEALED} stays closed while {len(waiting)} cases wait for their diagnosis "
            f"({shown}): run `blind --resume` first."
        )
    promised = digest or sealed_digest(directory)
    if promised is None:
        raise ConfigurationError(f"{directory} holds no sealed labels: generate the cases first.")
    try:
        plain = zlib.decompress(_mix((directory / SEALED).read_bytes(), secret))
    except zlib.error:
        raise ConfigurationError(
            f"{directory / SEALED} does not open with this --seed: give the seed of the generation."
        ) from None
    if hashlib.sha256(plain).hexdigest() != promised:
        raise ConfigurationError(
            f"{directory / SEALED} is not what its digest promised: the labels were changed; generate anew."
        )
    return json.loads(plain)


def refuse_other_draws(directory: Path, secret: str, labels: dict[str, Any]) -> None:
    """Raise ConfigurationError when recordings that were drawn again hide something else than the labels say.

    What is drawn again has its label sealed beside it. Processors differ in the last digits, and a draw that
    is accepted on one may be refused on another.
    """
    for name, first in labels.items():
        place = directory / "cases" / name
        if sealed_digest(place) is None:
            continue
        again = open_labels(place, secret, [])[name]
        kept = [(one["kind"], one["stage"], len(one["truth"])) for one in (again, first)]
        if kept[0] != kept[1] or not all(map(_alike, again["truth"], first["truth"])):
            raise ConfigurationError(
                f"{name} came out otherwise when it was drawn again on this machine: "
                f"go on where the run began."
            )


def _alike(one: dict[str, Any], other: dict[str, Any]) -> bool:
    """Whether two draws of an effect have the same name, place and, to a part in a hundred, sizes."""
    sizes = [{**truth["parameters"], "": truth["detectability"]} for truth in (one, other)]
    if (one["effect"], one["location"]) != (other["effect"], other["location"]):
        return False
    return sizes[0].keys() == sizes[1].keys() and all(
        math.isclose(value, sizes[1][key], rel_tol=0.01, abs_tol=1e-9) for key, value in sizes[0].items()
    )
