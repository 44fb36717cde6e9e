"""The executables of haptic_teleop_omni: name -> ("module:function", what it does in one line).

Read by setup.py (which makes the installed scripts of it), by the front door and by those who start nodes by
name. It imports nothing, so that it can be read before anything is installed.
"""

EXECUTABLES: dict[str, tuple[str, str]] = {}
