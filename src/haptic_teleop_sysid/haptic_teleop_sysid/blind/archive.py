"""One file with all that a sealed run has said so far, so that another machine or day can go on with it.

It holds the plan, the sealed labels with their digest, and of every case that has run how its diagnosis ended
and what it said. Recordings are not in it: they are drawn again from the seed where they are needed.
"""

from __future__ import annotations

import io
import re
import tarfile
from pathlib import Path

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_sysid.blind.runner import RAN
from haptic_teleop_sysid.blind.sealing import DIGEST, SEALED

PLAN = "plan.json"
SAID = "diagnosis/diagnosis.json"
_KNOWN = re.compile(rf"{PLAN}|{SEALED}|{DIGEST}|cases/case\d{{4,6}}/({RAN}|{SAID})")
_MOST_BYTES = 10_000_000  # of one member; a diagnosis has ten thousand


def pack(output: Path, file: Path) -> int:
    """Write the run in ``output`` to ``file`` (.tar.xz); return how many cases have run.

    Equal runs make equal files, and no path of this machine stays in them.
    """
    ran = sorted(output.glob(f"cases/*/{RAN}"))
    members = [output / name for name in (PLAN, SEALED, DIGEST)]
    members += [path for one in ran for path in (one, one.parent / SAID) if path.exists()]
    begun = file.with_name(file.name + ".part")
    file.parent.mkdir(parents=True, exist_ok=True)
    with tarfile.open(begun, "w:xz") as archive:
        for path in members:
            content = path.read_bytes()
            if path.suffix == ".json":
                content = content.replace(f"{output}/".encode(), b"")
            told = tarfile.TarInfo(str(path.relative_to(output)))
            told.size = len(content)
            archive.addfile(told, io.BytesIO(content))
    begun.replace(file)
    return len(ran)


def unpack(file: Path, output: Path) -> None:
    """Write what ``file`` holds into ``output``; what is there already stays as it is.

    ConfigurationError for a file that is none of ours: only the names that `pack` writes are accepted.
    """
    try:
        with tarfile.open(file, "r:xz") as archive:
            contents = {}
            for member in archive:
                content = archive.extractfile(member) if member.isfile() else None
                if content is None or not _KNOWN.fullmatch(member.name) or member.size > _MOST_BYTES:
                    raise ConfigurationError(
                        f"{file} holds {member.name!r}, which no run writes: "
                        f"give a file of `blind --archive`."
                    )
                contents[member.name] = content.read()
    except (tarfile.TarError, EOFError, OSError) as error:
        raise ConfigurationError(
            f"{file} cannot be read as an archive of a run ({error}): give a file of `blind --archive`."
        ) from None
    if missing := [name for name in (PLAN, SEALED, DIGEST) if name not in contents]:
        raise ConfigurationError(f"{file} lacks {', '.join(missing)}: give a file of `blind --archive`.")
    # How a case ended comes last: without what it said it would count as failed.
    for name in sorted(contents, key=lambda n: n.endswith(RAN)):
        path = output / name
        if not path.exists():
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(contents[name])
