# SPDX-License-Identifier: Apache-2.0
# shellcheck shell=bash
# Sourced by ./run, ./test and ./bench after they set `root`: installs the missing packages and builds. Everything
# it says goes to stderr, so that stdout carries only results. A second call finds nothing to do in under a second.

: "${root:?set by the script that sources this}"

say() { printf '%s\n' "$*" >&2; }
fail() {
    say "error: $1"
    shift
    (($# == 0)) || printf '       %s\n' "$@" >&2
    exit 3
}

# missing_packages GROUP...: those packages of these groups in packages.txt that are not installed, one a line.
missing_packages() {
    local wanted group package _
    wanted=$(while read -r group package _; do
        case " $* " in *" $group "*) printf '%s\n' "$package" ;; esac
    done <"$root/packages.txt" | sort -u)
    local states
    # shellcheck disable=SC2086  # package names, one word each
    states=$(dpkg-query -W -f '${db:Status-Status} ${Package}\n' $wanted 2>/dev/null) || true  # 1: some are unknown
    comm -23 <(printf '%s\n' "$wanted") <(sed -n 's/^installed //p' <<<"$states" | sort -u)
}

# install_packages GROUP...: asks nothing; needs root or a sudo that needs no password.
install_packages() {
    if ! command -v dpkg-query >/dev/null || ! command -v apt-get >/dev/null; then
        fail "this system has no apt-get: nephos is built and tested on Debian 12 (bookworm)." \
            "The packages it needs are listed in $root/packages.txt"
    fi
    local names missing
    names=$(missing_packages "$@")  # not by process substitution, which would hide a failure
    [[ -n $names ]] || return 0
    mapfile -t missing <<<"$names"

    local as_root=()
    if [[ $(id -u) != 0 ]]; then
        if ! command -v sudo >/dev/null || ! sudo -n true 2>/dev/null; then
            fail "${#missing[@]} packages are missing, and installing them takes root's rights. Run this once:" \
                "" "sudo apt-get update && sudo apt-get install --no-install-recommends ${missing[*]}"
        fi
        as_root=(sudo -n)
    fi
    say "Installing ${#missing[@]} packages with apt:"
    printf '  %s\n' "${missing[@]}" >&2
    local apt=("${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get -q -y -o DPkg::Lock::Timeout=300)
    "${apt[@]}" update >&2 ||
        fail "apt-get update failed (see above): is the network there?"
    "${apt[@]}" install --no-install-recommends "${missing[@]}" </dev/null >&2 ||
        fail "apt-get could not install the packages (see above)." \
            "nephos is built and tested on Debian 12; this is $(. /etc/os-release && printf '%s' "${PRETTY_NAME:-unknown}")."
}

# Compilers at once: one a core, but 1.5 GiB of memory for each (OpenVDB's headers are heavy).
build_jobs() {
    local cores memory_mib jobs
    cores=$(nproc)
    memory_mib=$(awk '/^MemAvailable:/ { print int($2 / 1024) }' /proc/meminfo)
    jobs=$((memory_mib / 1536))
    ((jobs < cores)) || jobs=$cores
    ((jobs > 0)) || jobs=1
    printf '%s' "$jobs"
}

# build PRESET TARGET...: configures build/PRESET when needed and builds the targets.
build() {
    local preset=$1 tree=$root/build/$1
    shift
    local fresh=() home=
    if [[ -f $tree/CMakeCache.txt ]]; then
        home=$(sed -n 's/^CMAKE_HOME_DIRECTORY:INTERNAL=//p' "$tree/CMakeCache.txt")
        # A tree that was configured elsewhere (a moved or copied checkout) cannot be reused.
        [[ $home == "$root" ]] || fresh=(--fresh)
    fi
    if [[ ! -f $tree/build.ninja || ${#fresh[@]} != 0 || $root/CMakePresets.json -nt $tree/build.ninja ]]; then
        say "Configuring $tree"
        mkdir -p "$tree"
        if ! (cd "$root" && cmake --preset "$preset" "${fresh[@]}") >"$tree/configure.log" 2>&1; then
            cat "$tree/configure.log" >&2
            rm -f "$tree/build.ninja"
            fail "cmake could not configure $tree (see above)."
        fi
        touch "$tree/build.ninja"
    fi
    local quiet=()
    if [[ ! -t 2 ]]; then quiet=(--quiet); fi
    # A dry run tells in a fraction of a second whether there is anything to do (and to say).
    if ninja -C "$tree" -n "$@" 2>/dev/null | grep -q 'no work to do'; then return 0; fi
    say "Building $tree (the first time takes some minutes)"
    ninja -C "$tree" -j "$(build_jobs)" "${quiet[@]}" "$@" >&2 || fail "the build failed (see above)."
}
