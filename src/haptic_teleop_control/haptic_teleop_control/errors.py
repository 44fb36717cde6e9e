"""The exceptions of the project.

Each message is one sentence that names the file, the key and the remedy: it is what the user reads, without a
traceback (see `command_line.run_command`). Each class also extends `ValueError`, because the cause is always
a value that came from outside; a failure of the program itself is never one of these.
"""


class HapticTeleopError(Exception):
    """Something the user can put right: bad settings, a bad file, files that do not fit together."""


class ConfigurationError(HapticTeleopError, ValueError):
    """A setting is unknown, missing, of the wrong type or out of range: YAML key, parameter, argument."""


class ModelError(HapticTeleopError, ValueError):
    """A model file cannot be used: unknown structure or effect, missing, unknown or impossible parameter."""


class RecordingError(HapticTeleopError, ValueError):
    """A recording cannot be used: not there, unreadable, truncated beyond use, or without a needed signal."""


class MismatchError(HapticTeleopError, ValueError):
    """A model and a recording do not belong together: another robot, joint, or set of signals."""
