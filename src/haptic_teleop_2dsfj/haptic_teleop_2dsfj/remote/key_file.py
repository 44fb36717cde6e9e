"""The key that a board server and its driver share: a file with 64 hexadecimal digits, of its user alone."""

from __future__ import annotations

import os
import secrets
import stat
from pathlib import Path

import platformdirs

from haptic_teleop_control.errors import ConfigurationError

KEY_BYTES = 32


def default_key_file() -> Path:
    """Where the key lies when no file is named: the same for server and driver of one user."""
    return Path(platformdirs.user_config_dir("haptic_teleop", appauthor=False)) / "board.key"


def read_key(name: str, make: bool = False) -> bytes:
    """The key in the file `name`, or in the default file where that is empty; make: make that one where it is
    missing, which the server does.

    Raises ConfigurationError: missing, no key, or readable by others (where files have owners and modes).
    """
    path = Path(name) if name else default_key_file()
    if make and not name and not path.exists():
        make_key(path)
    try:
        text = path.read_text(encoding="ascii").strip()
        mode = path.stat().st_mode
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "it is not text"
        raise ConfigurationError(
            f"{path}: the board server's key cannot be read ({reason}); copy the file that the server names "
            "in its first line to this computer, and name it in remote.key.file (the server: key.file; "
            "`sfj_board_server --make-key FILE` writes one)."
        ) from error
    if os.name == "posix" and mode & (stat.S_IRWXG | stat.S_IRWXO):
        raise ConfigurationError(
            f"{path}: others may read or write the board server's key (mode {stat.S_IMODE(mode):04o}); make "
            f"a new one, or `chmod 600 {path}` if nobody has."
        )
    try:
        key = bytes.fromhex(text)
    except ValueError:
        key = b""
    if len(key) != KEY_BYTES:
        raise ConfigurationError(
            f"{path}: is no key of {2 * KEY_BYTES} hexadecimal digits; make one with `haptic-teleop "
            "sfj_board_server --make-key FILE`."
        )
    return key


def make_key(path: Path) -> None:
    """A new random key into the file `path`, which must not exist. Raises ConfigurationError."""
    try:
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    except OSError as error:
        raise ConfigurationError(
            f"{path}: no key can be made there ({error.strerror}); name another file."
        ) from error
    with os.fdopen(descriptor, "w", encoding="ascii") as file:
        file.write(secrets.token_hex(KEY_BYTES) + "\n")
