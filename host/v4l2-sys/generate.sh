#!/usr/bin/env bash
# Writes src/bindings.rs from this machine's <linux/videodev2.h>. Needs bindgen and libclang:
# apt-get install bindgen libclang-dev linux-libc-dev. Run it where pointers have 64 bits.
#
# The lists are what version 0.14 of the crate v4l names; whatever these types hold comes along, but for
# the codecs' control structures, which are only pointed at.
set -euo pipefail
cd "$(dirname "$0")"

TYPES='audio|audioout|buffer|capability|captureparm|control|crop|cropcap|edid|enc_idx|encoder_cmd|exportbuffer'
TYPES+='|ext_control|ext_controls|fmtdesc|format|fract|framebuffer|frequency|frmivalenum|frmivaltypes'
TYPES+='|frmsizeenum|frmsizetypes|input|jpegcompression|modulator|output|outputparm|pix_format|query_ext_ctrl'
TYPES+='|queryctrl|querymenu|requestbuffers|sliced_vbi_cap|standard|std_id|streamparm|tuner'

header=$(mktemp --suffix=.h)
trap 'rm -f "$header"' EXIT
echo '#include <linux/videodev2.h>' >"$header"

pointed_at=()
for name in $(grep -oE '\bv4l2_ctrl_[a-z0-9_]+ ' /usr/include/linux/v4l2-controls.h | sort -u); do
    if grep -qE "struct $name +__user \*|struct $name +\*" /usr/include/linux/videodev2.h; then
        pointed_at+=(--raw-line "pub type $name = ::std::os::raw::c_void;")
    fi
done

bindgen "$header" --no-layout-tests --no-derive-debug --no-doc-comments \
    --allowlist-type "v4l2_($TYPES)" --allowlist-type time_t \
    --allowlist-var 'V4L2_CTRL_FLAG_NEXT_(CTRL|COMPOUND)' \
    --blocklist-type 'v4l2_ctrl_.*' "${pointed_at[@]}" \
    --output src/bindings.rs
