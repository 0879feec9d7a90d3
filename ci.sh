#!/usr/bin/env bash
# The one list of checks.
#
#   ./ci.sh            everything
#   ./ci.sh NAME...    single parts: fmt lint test bench doc firmware v4l2 fuzz miri; qemu, which test contains;
#                      supply, which installs tools for minutes, fleet, which builds the optional features, and
#                      miri_whole: these three are run where changes are merged
#
# Installs what a fresh Debian machine with rustup lacks. The last line is "N passed, N failed", counting
# tests, and one for each check that is not made of tests. A part that ran no test fails. Exit codes: 0 all
# passed, 1 something failed, 2 no such part.
set -uo pipefail
cd "$(dirname "$0")" || exit 1

PARTS=(fmt lint test bench doc firmware v4l2 fuzz miri)
TARGET=thumbv7em-none-eabihf
CASES=../shared/eval

passed=0
failed=0
# What failed, said again at the end: the log above is long.
broken=()
log=$(mktemp)
trap 'rm -f "$log"' EXIT

fail() {
    echo "FAILED: $1"
    failed=$((failed + 1))
    broken+=("$1")
}

# Run a command as one check.
check() {
    echo "+ $*"
    if "$@"; then passed=$((passed + 1)); else fail "$*"; fi
}

# Run a command that prints cargo's "test result:" lines, and count its tests.
tests() {
    echo "+ $*"
    "$@" 2>&1 | tee "$log"
    local status=$? before=$failed ok name
    ok=$(awk '/^test result:/ { n += $4 } END { print n + 0 }' "$log")
    passed=$((passed + ok))
    while read -r name; do fail "$name"; done < <(awk '/^test .* \.\.\. FAILED$/ { print $2 }' "$log")
    if [ "$status" -ne 0 ] && [ "$failed" -eq "$before" ]; then fail "$*"; fi
    if [ "$ok" -eq 0 ] && [ "$failed" -eq "$before" ]; then fail "no test ran: $*"; fi
}

# apt-get, as whoever may.
install() {
    local sudo=
    [ "$(id -u)" -eq 0 ] || sudo=sudo
    $sudo apt-get update -qq && DEBIAN_FRONTEND=noninteractive $sudo apt-get install -y -qq --no-install-recommends "$@"
}

need() {
    command -v "$1" >/dev/null || install "${@:2}"
}

# End before anything has run: a reason, and an exit code.
give_up() {
    echo "FAILED: $1"
    echo "0 passed, 1 failed"
    exit "$2"
}

prepare() {
    need cc gcc libc6-dev
    command -v cargo >/dev/null ||
        give_up "cargo is missing: install Rust with rustup (https://rustup.rs), then run this again" 1
}

# A part of the toolchain: how to see that it is there, what to say without rustup, and rustup's arguments.
toolchain() {
    eval "$1" >/dev/null 2>&1 && return
    if command -v rustup >/dev/null; then rustup "${@:3}"; else echo "there is no rustup: $2"; fi
}

# Whether a Python can run the ruler.
can_measure() {
    "$1" -c 'import cv2, trimesh, embreex' 2>/dev/null
}

# The Python that runs the ruler of the shared cases, where these are.
ruler() {
    local venv=target/eval-venv
    [ -d "$CASES" ] || { echo "SKIPPED: $CASES is not here, so the cases with known truth are not run"; return; }
    if ! can_measure "$venv/bin/python"; then
        need python3 python3 python3-venv
        python3 -m venv "$venv" || { install python3-venv && python3 -m venv "$venv"; }
        "$venv/bin/pip" install -q --disable-pip-version-check -r "$CASES/requirements.txt"
    fi
    if ! can_measure "$venv/bin/python"; then
        echo "SKIPPED: the ruler's Python packages could not be installed: NO case with known truth is run"
        [ "${CI:-}" != true ] || fail "in CI the cases with known truth must run"
        return
    fi
    export OSSATURE_RULER=$PWD/$venv/bin/python
}

# The boards' processor, which images are built for.
board_target() {
    toolchain 'ls "$(rustc --print target-libdir --target "$TARGET")"/libcore-*.rlib' \
        "install Rust with rustup (https://rustup.rs), which has the target $TARGET" target add "$TARGET"
}

# Boards to run images on.
emulator() {
    board_target
    need qemu-system-arm qemu-system-arm
}

# File systems of one's own, to be full soon, which Ubuntu grants nobody but root unless it is told to.
small_disks() {
    unshare -rm true 2>/dev/null || sudo -n sysctl -q -w kernel.apparmor_restrict_unprivileged_userns=0
}

part_fmt() {
    toolchain "cargo fmt --version" "install rustfmt (Debian: apt-get install rustfmt)" component add rustfmt
    check cargo fmt --all --check
    check cargo fmt --manifest-path fuzz/Cargo.toml --check
}

part_lint() {
    toolchain "cargo clippy --version" "install clippy (Debian: apt-get install rust-clippy)" component add clippy
    check cargo clippy -q --workspace --all-targets --locked -- -D warnings
}

part_test() {
    ruler
    emulator
    # What the report page is looked at with.
    need chromium chromium
    small_disks
    tests cargo test --workspace --locked --no-fail-fast
    # The frozen bits again, as the optimiser makes them, and the command that a newcomer runs first.
    tests cargo test --release --locked -p system-tests --test determinism --test warp
    check cargo run -q --release --locked -p host -- demo --out target/ci-demo
}

# Each bench runs, once; what it takes is for a quiet machine. Against other programs: tests/peers/README.md.
part_bench() { check cargo bench -q --locked -p system-tests -- --test 640x480; }

part_doc() { RUSTDOCFLAGS="-D warnings" check cargo doc -q --workspace --no-deps --locked; }

# What of an image goes to a board's flash. Names of symbols beside it are made of what is called where.
flashed() {
    readelf -x .vector_table -x .text -x .rodata -x .data "$1"
}

# The camera's image from another folder, which must be the same to the byte.
same_elsewhere() {
    local folder image=$TARGET/release/camera status
    folder=$(mktemp -d "${TMPDIR:-/tmp}/a folder elsewhere.XXXXXX") || return 1
    tar -cf - .cargo Cargo.lock Cargo.toml firmware host memory.x shared tests | tar -xf - -C "$folder"
    (cd "$folder" && CARGO_TARGET_DIR=built cargo build -q -p firmware --target "$TARGET" --release --locked) &&
        flashed "target/$image" >"$folder/here" && flashed "$folder/built/$image" >"$folder/there" &&
        [ -s "$folder/here" ] && cmp "$folder/here" "$folder/there"
    status=$?
    rm -rf "$folder"
    return "$status"
}

part_firmware() {
    emulator
    # Boards exclude each other: one at a time, and each is looked at as closely as the rest.
    local features
    for features in h743 mps2; do
        check cargo clippy -q -p firmware --target "$TARGET" --release --locked --no-default-features \
            --features "$features" -- -D warnings
    done
    # The core in a firmware of one's own.
    check cargo clippy -q -p shared --example sketch --target "$TARGET" --release --locked -- -D warnings
    # As the user builds it, and what it takes.
    check cargo build -q -p firmware --target "$TARGET" --release --locked
    # What it takes, and what it is made of: panics, the deepest stack.
    tests cargo test -q --locked -p system-tests --test footprint --test images -- --nocapture
}

# What images take; the core on emulated boards held against the core on this machine, stage by stage, and to
# the instructions that it took before; and the whole device on such a board, listened to.
part_qemu() {
    emulator
    tests cargo test -q --locked -p system-tests --test emulator --test instructions --test emulated_link \
        --test footprint -- --nocapture
}

# Capture from a real driver, in an emulated machine with a kernel that has one.
part_v4l2() {
    # The kernel is fetched by today's list of packages.
    ls -d target/v4l2/linux-image-* >/dev/null 2>&1 || install
    need qemu-system-x86_64 qemu-system-x86
    need busybox busybox-static
    need v4l2-ctl v4l-utils
    check cargo build -q --release --locked -p host
    tests cargo test --release --locked -p system-tests --test v4l2 -- --ignored --nocapture
}

# Inputs for a minute, on whatever reads some (fuzz/run).
part_fuzz() {
    need c++ g++
    check fuzz/run 10
}

# Undefined behaviour, looked for by an interpreter in the core's tests, with words of 32 bits: elsewhere libm's square
# root is assembly, which it cannot read.
interpreted() {
    toolchain "cargo +nightly miri --version" "install Rust with rustup (https://rustup.rs), which has Miri" \
        toolchain install nightly --component miri,rust-src
    tests cargo +nightly miri test --locked -p shared --lib --target armv7-unknown-linux-gnueabihf -- "$@"
}

# Without the tests that an interpreter takes longest for.
part_miri() { interpreted --skip a_disc_is_found --skip masks_of_every_width --skip logarithm_of_powers; }

part_miri_whole() { interpreted; }

# A Python with Zenoh, as a foreign client.
foreign_client() {
    local venv=target/fleet-venv
    if ! "$venv/bin/python" -c 'import zenoh' 2>/dev/null; then
        need python3 python3 python3-venv
        python3 -m venv "$venv" || { install python3-venv && python3 -m venv "$venv"; }
        "$venv/bin/pip" install -q --disable-pip-version-check 'eclipse-zenoh>=1.10,<2'
    fi
    if ! "$venv/bin/python" -c 'import zenoh' 2>/dev/null; then
        echo "SKIPPED: Python's Zenoh could not be installed: NO foreign client is tried"
        [ "${CI:-}" != true ] || fail "in CI a foreign client must run"
        return
    fi
    export OSSATURE_ZENOH_PYTHON=$PWD/$venv/bin/python
}

# Pairs that machines make together: a queue's server, and workers that are killed; and live boards, simulated.
part_fleet() {
    need nats-server nats-server
    need openssl openssl
    foreign_client
    check cargo clippy -q -p host --all-targets --features batch,fleet --locked -- -D warnings
    tests cargo test -q --release --locked -p host --features batch,fleet --test batch --test fleet
    tests cargo test -q --release --locked -p host --features batch,fleet --lib -- batch:: fleet:: subscribe::
    check cargo build -q --release --locked -p host --features batch,fleet
    # What the boards are made of has no fleet, so it is not built anew.
    OSSATURE_HOST=$PWD/target/release/host \
        tests cargo test -q --release --locked -p system-tests --test fleet -- --ignored
}

# Third-party code: licences, duplicates and sources (deny.toml), and what each package is made of, as
# PACKAGE/PACKAGE.cdx.json; and that an image is made of nothing else. Known vulnerabilities need the network: the
# hosted workflow asks for them.
part_supply() {
    board_target
    check cargo build -q -p firmware --target "$TARGET" --release --locked
    check same_elsewhere
    local tool
    for tool in cargo-deny cargo-cyclonedx; do
        command -v "$tool" >/dev/null || cargo install -q --locked "$tool"
    done
    cargo fetch -q --locked
    check cargo deny --offline --locked check licenses bans sources
    check cargo cyclonedx -q --format json --spec-version 1.5 --target all --all-features
}

parts=("$@")
[ "${#parts[@]}" -gt 0 ] || parts=("${PARTS[@]}")
for part in "${parts[@]}"; do
    declare -F "part_$part" >/dev/null || give_up "unknown part '$part'; there are: ${PARTS[*]}" 2
done
prepare
for part in "${parts[@]}"; do
    echo "== $part"
    start=$SECONDS before=$((passed + failed))
    "part_$part"
    [ $((passed + failed)) -gt "$before" ] || fail "$part did nothing"
    echo "== $part: $((SECONDS - start)) s"
done
for name in "${broken[@]}"; do echo "FAILED: $name"; done
echo "$passed passed, $failed failed"
[ "$failed" -eq 0 ]
