"""Whether code that lies in a folder may be executed: only when nobody but its user can have put it there.

Compiled code is loaded with pickle: whoever can write into the folder where it is kept can have anything
executed by everybody who loads it.
"""

from __future__ import annotations

import os
import stat
import sys
from contextlib import suppress
from pathlib import Path

NUMBA = "NUMBA_CACHE_DIR"
_OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH
_OTHERS_ENTER = stat.S_IXGRP | stat.S_IXOTH


def prepare_private(folder: Path) -> str | None:
    """Makes ``folder`` where it is missing; why it must not be used, as `untrusted`, or None."""
    try:
        make_private(folder)
        return untrusted(folder)
    except OSError as refusal:
        return f"{folder} cannot be used ({refusal.strerror or refusal})"


def refuse_untrusted_numba_cache() -> None:
    """Takes NUMBA_CACHE_DIR out of the environment, with a warning, where others may have put something into
    that folder; to be called before numba is imported."""
    named = os.environ.get(NUMBA)
    problem = prepare_private(Path(named)) if named else None
    if problem is not None:
        print(f"haptic-teleop: warning: {NUMBA} is not used: {problem}", file=sys.stderr, flush=True)
        del os.environ[NUMBA]


def make_private(folder: Path) -> None:
    """Makes ``folder`` and what is missing above it, for the user alone; raises OSError where that fails."""
    if not os.path.lexists(folder.parent):
        make_private(folder.parent)
    if not os.path.lexists(folder):
        with suppress(FileExistsError):  # another process was faster
            folder.mkdir(mode=0o700)


def untrusted(folder: Path) -> str | None:
    """Why code that lies in ``folder`` must not be executed, as a sentence without its end, or None.

    It must be a real directory (no symbolic link) that belongs to this user and that nobody else may write;
    so must everything in it. Of the directories above it, those on the way by name and those of the real
    place, each must belong to this user or to root, and nobody else may put something else in place of what
    lies in them: they are not writable for others, or have the sticky bit, as /tmp has.
    """
    folder = Path(os.path.abspath(folder))
    if not hasattr(os, "geteuid"):
        return f"{folder}: this system does not tell who owns it"
    status = folder.lstat()
    if stat.S_ISLNK(status.st_mode):
        return f"{folder} is a symbolic link"
    if not stat.S_ISDIR(status.st_mode):
        return f"{folder} is no directory"
    if problem := _not_mine(folder, status):
        return problem
    for parent in dict.fromkeys([*folder.parents, *folder.resolve().parents]):
        if problem := _replaceable(parent):
            return problem
    # Where others cannot enter, what may be written inside does not matter to them.
    entered = bool(status.st_mode & _OTHERS_ENTER)
    for place, folders, files in os.walk(folder):
        for name in (*folders, *files):
            entry = os.path.join(place, name)  # as a Path it takes five times as long, of thousands
            try:
                found = os.lstat(entry)
            except FileNotFoundError:  # another process' scratch file
                continue
            if stat.S_ISLNK(found.st_mode):
                return f"{entry} is a symbolic link"
            if problem := _not_mine(entry, found, writable_matters=entered):
                return problem
    return None


def _not_mine(path: str | Path, status: os.stat_result, writable_matters: bool = True) -> str | None:
    if status.st_uid != os.geteuid():
        return f"{path} belongs to {_user(status.st_uid)}"
    if writable_matters and status.st_mode & _OTHERS_WRITE:
        return f"others may write to {path} (mode {stat.S_IMODE(status.st_mode):04o})"
    return None


def _replaceable(parent: Path) -> str | None:
    """Why what lies in ``parent`` may be replaced by somebody else, or None."""
    status = parent.lstat()
    if status.st_uid not in (0, os.geteuid()):
        return f"{parent}, in which it lies, belongs to {_user(status.st_uid)}"
    if stat.S_ISLNK(status.st_mode) or status.st_mode & stat.S_ISVTX:
        return None  # a link's mode means nothing; where it leads is looked at by the real path
    writers = status.st_mode & _OTHERS_WRITE
    if writers == stat.S_IWGRP and _alone_in(status.st_gid):
        return None
    if writers:
        return f"others may replace what lies in {parent} (mode {stat.S_IMODE(status.st_mode):04o})"
    return None


def _alone_in(group: int) -> bool:
    """Whether it is the group that many systems give each user, of the same name and with nobody else in it:
    with their umask of 002 every directory is writable for it."""
    import grp  # not on Windows, where the board server runs, which comes by here and asks for no folder
    import pwd

    try:
        known, user = grp.getgrgid(group), pwd.getpwuid(os.geteuid())
    except KeyError:
        return False
    return group == user.pw_gid and known.gr_name == user.pw_name and set(known.gr_mem) <= {user.pw_name}


def _user(number: int) -> str:
    import pwd

    try:
        return f"the user {pwd.getpwuid(number).pw_name}"
    except KeyError:
        return f"the user {number}"
