#!/usr/bin/env bash
# A machine whose cameras are the kernel's own test driver.
#
#   machine.sh HOST WORK OUT
#
# Boots Debian's kernel in an emulator, with `vivid` as its cameras and nothing else in it than busybox,
# v4l2-ctl, the binary HOST and the folder WORK; runs WORK/run there and leaves what that left in /out in the
# folder OUT, beside console.log. Nothing is installed and no module is loaded on this machine.
#
# The kernel is fetched once, into target/v4l2. Exit codes: 0 WORK/run was run to its end and succeeded, 1 it was
# not, or failed, 3 something that the machine is made of cannot be had.
set -euo pipefail

HOST=$1 WORK=$2 OUT=$3
CACHE=$(cd "$(dirname "$0")/../.." && pwd)/target/v4l2
INIT=$(dirname "$0")/init
# Longest that the machine may run, s.
LIMIT=600
# What it says last, and the emulator's exit code for the 0x10 that it writes to the port of its debug device.
MARKER="machine: passed"
PASSED=33

missing() {
    echo "machine.sh: $1" >&2
    exit 3
}

# A kernel that was fetched before, else the distribution's current one: its file in $KERNEL, its modules below
# $MODULES.
fetch_kernel() {
    local package fresh
    package=$(find "$CACHE" -maxdepth 1 -name 'linux-image-*' -printf '%f\n' 2>/dev/null | sort -V | tail -n 1) || true
    if [ -z "$package" ]; then
        package=$(apt-cache depends linux-image-amd64 2>/dev/null | sed -n 's/^ *Depends: \(linux-image-[^ ]*\)$/\1/p') ||
            true
        [ -n "$package" ] || missing "no package linux-image-amd64 is known: this needs Debian, and apt-get update"
        mkdir -p "$CACHE" && fresh=$(mktemp -d "$CACHE/fresh.XXXXXX")
        # Unpacked, not installed; and in its place when it is whole.
        (cd "$fresh" && apt-get download -qq "$package" && dpkg-deb --fsys-tarfile ./*.deb |
            tar -x ./boot "./lib/modules/${package#linux-image-}/kernel/drivers/media" && rm ./*.deb) ||
            { rm -rf "$fresh" && missing "$package cannot be fetched; apt-get update may help"; }
        mv "$fresh" "$CACHE/$package"
    fi
    MODULES=$CACHE/$package/lib KERNEL=$CACHE/$package/boot/vmlinuz-${package#linux-image-}
}

# Copies a module behind those it depends on, and notes the order.
add_module() {
    local name=${1//-/_} file needed
    [ ! -e "$ROOT/modules/$name.ko" ] || return 0
    file=$(find "$MODULES" \( -name "$name.ko" -o -name "${name//_/-}.ko" \) -print -quit)
    [ -n "$file" ] || missing "the kernel has no module $name"
    for needed in $(tr '\0' '\n' <"$file" | sed -n 's/^depends=//p' | tr ',' ' '); do add_module "$needed"; done
    cp "$file" "$ROOT/modules/$name.ko"
    echo "$name" >>"$ROOT/modules/order"
}

# Copies a program to /bin, and its libraries to where it looks for them.
add_program() {
    local file library
    file=$(command -v "$1") || missing "$1 is missing; ./ci.sh v4l2 installs it"
    cp -L "$file" "$ROOT/bin/${2:-$(basename "$file")}"
    # A static program has none.
    for library in $(ldd "$file" 2>/dev/null | grep -o '/[^ ]*'); do cp -L --parents "$library" "$ROOT"; done
}

command -v qemu-system-x86_64 >/dev/null || missing "qemu-system-x86_64 is missing; ./ci.sh v4l2 installs it"
fetch_kernel
rm -rf "$OUT" && mkdir -p "$OUT"
OUT=$(cd "$OUT" && pwd) ROOT=$OUT/root
mkdir -p "$ROOT"/{bin,dev,proc,sys,tmp,out,modules}
add_module vivid
add_program busybox
add_program v4l2-ctl
add_program "$HOST" host
cp -r "$WORK" "$ROOT/job"
cp "$INIT" "$ROOT/init"
(cd "$ROOT" && find . | busybox cpio -o -H newc 2>/dev/null) >"$OUT/initramfs"
rm -rf "$ROOT"

# Emulated throughout: a nested hypervisor is not everywhere, and where it is, it can hang. The machine's clock
# counts its instructions, one a nanosecond, and skips what it waits: so it is never late, however busy this
# machine is, and times within it mean something.
code=0
timeout -k 5 "$LIMIT" qemu-system-x86_64 -accel tcg -icount shift=0,sleep=off -cpu max -m 768 \
    -no-reboot -nodefaults -display none -kernel "$KERNEL" -initrd "$OUT/initramfs" \
    -append "console=ttyS0 loglevel=1 panic=-1 mitigations=off nokaslr" \
    -serial "file:$OUT/console.log" -serial "file:$OUT/out.tar.gz" -device isa-debug-exit,iobase=0xf4 ||
    code=$?
rm "$OUT/initramfs"
tar -xmzf "$OUT/out.tar.gz" -C "$OUT" 2>/dev/null || code="$code and nothing sent"
rm "$OUT/out.tar.gz"
if [ "$code" != "$PASSED" ] || ! grep -q "^$MARKER" "$OUT/console.log"; then
    echo "machine.sh: the machine ended with $code instead of $PASSED; the end of what it said:" >&2
    tail -n 20 "$OUT/console.log" >&2
    exit 1
fi
