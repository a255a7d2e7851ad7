# Sourced by the other scripts: the project's own Python environment in .venv, made when it is missing or out of date.
# shellcheck shell=bash

root=$(cd -P -- "$(dirname -- "${BASH_SOURCE[0]}")/.." && pwd)

say() { printf '%s: %s\n' "${0##*/}" "$1" >&2; }

# is_old PYTHON: true if it runs and is too old.
is_old() { "$1" -c 'import sys; sys.exit(sys.version_info >= (3, 11))' 2>/dev/null; }

# find_python: the first Python that is new enough and can make an environment, in $python.
find_python() {
    local candidate old="" bare=""
    for candidate in ${PYTHON:-python3.14 python3.13 python3.12 python3.11 python3 python}; do
        command -v "$candidate" >/dev/null || continue
        if ! "$candidate" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then
            old=$candidate
        elif ! "$candidate" -c 'import ensurepip, venv' 2>/dev/null; then
            bare=$candidate
        else
            python=$candidate
            return
        fi
    done
    if [[ $bare ]]; then
        say "$bare lacks the venv module; install it (Debian, Ubuntu: apt-get install python3-venv)"
    else
        say "needs Python 3.11 or newer${old:+; $old is older}; install it, or name it: PYTHON=/path/to/python3"
    fi
    exit 1
}

# is_current STAMP: true if the last installation was made from this folder and this pyproject.toml.
is_current() {
    [[ -x $root/.venv/bin/python && -f $1 && $(<"$1") == "$root"$'\n'"$(<"$root/pyproject.toml")" ]]
}

# install_packages ARGUMENT...: pip install into .venv, with a line for each package, since the first time takes minutes.
# $pip_options has further options of pip, and $beside_pip the name of a function that runs meanwhile.
pip_options=()
beside_pip=
install_packages() {
    "$root/.venv/bin/python" -m pip install --disable-pip-version-check ${pip_options[@]+"${pip_options[@]}"} "$@" | while IFS= read -r line; do
        case $line in
            Collecting\ *)
                line=${line#Collecting }
                say "  ${line%%[ <>=;]*}"
                ;;
            'Installing collected packages'*) say "  unpacking all of them" ;;
        esac
    done
}

# ensure_environment [EXTRAS]: install the package, editable, with its dependencies into .venv; EXTRAS as in pyproject.toml.
ensure_environment() {
    local extras=${1:-} stamp=$root/.venv/installed${1:+-$1}
    if is_current "$stamp"; then return; fi
    if ! mkdir -p "$root/.venv" 2>/dev/null || [[ ! -w $root/.venv ]]; then
        say "cannot write to $root/.venv, where the environment belongs"
        exit 1
    fi
    if command -v flock >/dev/null; then # two first starts at once: one installs, the other waits
        exec 9>"$root/.venv/lock"
        flock 9
    fi
    if ! is_current "$stamp"; then
        if [[ -x $root/.venv/bin/python ]] && is_old "$root/.venv/bin/python"; then
            say "needs Python 3.11 or newer; $root/.venv was made with an older one; remove that folder and start again"
            exit 1
        fi
        if ! "$root/.venv/bin/python" -m pip --version >/dev/null 2>&1; then
            find_python
            say "making .venv with $("$python" --version 2>&1)"
            "$python" -m venv "$root/.venv" >&2 || exit 1
        fi
        say "installing into .venv (once; later starts skip this)"
        if [[ $beside_pip ]]; then "$beside_pip" 9>&- & fi
        if ! install_packages --editable "$root${extras:+[$extras]}"; then
            say "the installation failed; see the output of pip above"
            exit 1
        fi
        printf '%s\n%s' "$root" "$(<"$root/pyproject.toml")" | tee "$root/.venv/installed" >"$stamp"
    fi
    exec 9>&-
}

# ensure_node_packages FOLDER WHAT: install the npm packages of a folder, which are WHAT, if Node is installed.
ensure_node_packages() {
    local at=$root/$1 what=$2
    if ! command -v node >/dev/null || ! command -v npm >/dev/null; then
        say "node or npm is missing: $what cannot run"
        return
    fi
    if [[ -f $at/node_modules/installed && $(<"$at/node_modules/installed") == "$(<"$at/package-lock.json")" ]]; then return; fi
    say "installing $what (once)"
    if ! npm ci --prefix "$at" --no-audit --no-fund --loglevel=error >&2; then
        say "npm could not install them; see its output above"
        return
    fi
    printf '%s' "$(<"$at/package-lock.json")" >"$at/node_modules/installed"
}

# ensure_debian PACKAGE WHAT COMMAND...: install a Debian package for WHAT of the tests, unless COMMAND succeeds.
# Without the right to install it, print a message.
is_apt_fresh=
ensure_debian() {
    local package=$1 what=$2
    if "${@:3}" >/dev/null 2>&1; then return; fi
    if ! command -v apt-get >/dev/null || ((EUID != 0)); then
        say "$package is missing: $what cannot run (Debian: apt-get install $package)"
        return
    fi
    say "installing $package for $what (once)"
    local -x DEBIAN_FRONTEND=noninteractive
    if ! { { [[ $is_apt_fresh ]] || apt-get --quiet=2 update; } &&
        apt-get --quiet=2 install --yes --no-install-recommends "$package"; } >/dev/null; then
        say "apt-get could not install it; see its output above"
        return
    fi
    is_apt_fresh=yes
}

# ensure_rclpy: nodes of ROS 2 for the long tests, in an environment of their own: .venv/rclpy, 300 MB, this package
# included. There are wheels for Python 3.11 on Linux x86-64 alone; there, what is missing fails where CI=true.
ensure_rclpy() {
    local at=$root/.venv/rclpy name packages=()
    if is_current "$at/installed" || [[ $(uname -sm) != "Linux x86_64" ]]; then return; fi
    if ! command -v python3.11 >/dev/null; then
        say "python3.11 is missing: the tests with rclpy cannot run"
        if [[ ${CI:-} == true ]]; then exit 1; fi
        return
    fi
    for name in rclpy rmw-fastrtps-cpp {std,sensor,nav,rosgraph,visualization,test}-msgs std-srvs rcl-interfaces; do
        packages+=("ros-jazzy-$name")
    done
    say "installing rclpy into .venv/rclpy (once)"
    if python3.11 -m venv "$at" && "$at/bin/python" -m pip install --quiet --disable-pip-version-check \
        "${packages[@]}" roslibpy --editable "$root[ros2]" >&2; then
        printf '%s\n%s' "$root" "$(<"$root/pyproject.toml")" >"$at/installed"
    else
        say "pip could not install it; see its output above"
        if [[ ${CI:-} == true ]]; then exit 1; fi
    fi
}

# ensure_ros1: nodes and tools of ROS 1 for the long tests, of Debian.
ensure_ros1() {
    local package
    for package in python3-rospy python3-roslaunch python3-rosnode python3-rostopic python3-rosservice python3-rosparam \
        python3-std-srvs python3-sensor-msgs python3-nav-msgs libroscpp-dev libstd-srvs-dev; do
        ensure_debian "$package" 'the tests with nodes of ROS 1' dpkg -s "$package"
    done
}

# ensure_torch: stable-baselines3 on Debian's torch for the long tests, in an environment of their own: .venv/torch, 220 MB.
# A torch from PyPI takes 4.6 GB. stable-baselines3 asks for a newer one, and runs on this one.
ensure_torch() {
    local at=$root/.venv/torch
    if is_current "$at/installed"; then return; fi
    ensure_debian python3-torch 'the tests that train with torch' /usr/bin/python3 -c 'import torch'
    if ! /usr/bin/python3 -c 'import ensurepip, torch' 2>/dev/null; then return; fi
    say "installing stable-baselines3 into .venv/torch (once)"
    if /usr/bin/python3 -m venv --system-site-packages "$at" &&
        "$at/bin/python" -m pip install --quiet --disable-pip-version-check cloudpickle --editable "$root[gym]" >&2 &&
        "$at/bin/python" -m pip install --quiet --disable-pip-version-check --no-deps 'stable-baselines3==2.9.*' >&2; then
        printf '%s\n%s' "$root" "$(<"$root/pyproject.toml")" >"$at/installed"
    else
        say "pip could not install it; see its output above"
    fi
}
