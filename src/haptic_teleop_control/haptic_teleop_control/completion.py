"""Completion of `haptic-teleop` in the shell: the executable's name first, file names after it.

The names are written into the script. It is printed anew whenever a shell starts, so it is never out of date,
and pressing TAB starts no Python.
"""

from collections.abc import Mapping

from haptic_teleop_control.errors import ConfigurationError

SHELLS = ("bash", "zsh", "fish")

_BASH = """\
_haptic_teleop() {{
    local word="${{COMP_WORDS[COMP_CWORD]}}"
    if [ "$COMP_CWORD" -eq 1 ]; then
        COMPREPLY=($(compgen -W "{names} --help --version --completion" -- "$word"))
    elif [ "${{COMP_WORDS[1]}}" = "--completion" ]; then
        COMPREPLY=($(compgen -W "{shells}" -- "$word"))
    else
        COMPREPLY=($(compgen -W "--help --ros-args" -- "$word") $(compgen -f -- "$word"))
    fi
}}
complete -o filenames -F _haptic_teleop haptic-teleop"""

_ZSH = """\
_haptic_teleop() {{
    local -a executables
    executables=({described})
    if (( CURRENT == 2 )); then
        _describe executable executables
    elif [[ $words[2] == --completion ]]; then
        compadd {shells}
    else
        compadd -- --help --ros-args
        _files
    fi
}}
compdef _haptic_teleop haptic-teleop"""

_FISH_HEAD = """\
complete -c haptic-teleop -e
complete -c haptic-teleop -n __fish_is_first_arg -f
complete -c haptic-teleop -n __fish_is_first_arg -l completion -x -a '{shells}' -d 'a completion script'
complete -c haptic-teleop -l help -d 'explain the arguments'"""


def completion_script(shell: str, executables: Mapping[str, str]) -> str:
    """The script that switches completion on in `shell`: "bash", "zsh" or "fish".

    `executables` maps each name to its line, which zsh and fish show beside the name. Raises
    ConfigurationError for any other shell.
    """
    if shell not in SHELLS:
        raise ConfigurationError(
            f"no completion for the shell {shell!r}: --completion takes one of {', '.join(SHELLS)}"
        )
    shells = " ".join(SHELLS)
    if shell == "bash":
        return _BASH.format(names=" ".join(executables), shells=shells)
    if shell == "zsh":
        # A colon separates name and description, so those within the description are escaped.
        escaped = {name: line.replace(":", "\\:") for name, line in executables.items()}
        described = " ".join(_quoted(f"{name}:{line}") for name, line in escaped.items())
        return _ZSH.format(described=described, shells=shells)
    lines = [_FISH_HEAD.format(shells=shells)]
    lines += [
        f"complete -c haptic-teleop -n __fish_is_first_arg -f -a {name} -d {_quoted(line)}"
        for name, line in executables.items()
    ]
    return "\n".join(lines)


def _quoted(text: str) -> str:
    return "'" + text.replace("'", "'\\''") + "'"
