//! The kernel's Video4Linux structures, for the crate `v4l`.
//!
//! This stands in the place of `v4l2-sys-mit` 0.3.0, which is nothing but what bindgen makes of
//! `<linux/videodev2.h>` during the build, and so wants libclang on every machine that builds. The bindings
//! here were made beforehand, by `generate.sh` with bindgen 0.60.1 and clang 14 from the header of Linux 6.1
//! (Debian's linux-libc-dev 6.1.187), and hold only what `v4l` 0.14 names. The header is the kernel's
//! interface to programs, which only grows: newer kernels serve it, and so do older ones down to what a
//! camera needs. docs/decisions/0006-v4l-bindings.md says why.
//!
//! The structures hold pointers and C longs, so the sizes below are held against those of the kernel: an
//! ioctl's number contains the size of its structure.

#[rustfmt::skip]
#[expect(
    missing_docs, non_camel_case_types, non_snake_case, non_upper_case_globals,
    reason = "generated from the kernel's names"
)]
mod bindings;

pub use bindings::*;

/// Sizes of what crosses to the kernel, bytes: on 64 bits, and on 32.
macro_rules! sizes {
    ($($structure:ident: $wide:literal, $narrow:literal;)*) => {
        $(const _: () = assert!(
            size_of::<$structure>() == if cfg!(target_pointer_width = "64") { $wide } else { $narrow }
        );)*
    };
}

sizes! {
    v4l2_buffer: 88, 68;
    v4l2_capability: 104, 104;
    v4l2_fmtdesc: 64, 64;
    v4l2_format: 208, 204;
    v4l2_frmivalenum: 52, 52;
    v4l2_frmsizeenum: 44, 44;
    v4l2_pix_format: 48, 48;
    v4l2_requestbuffers: 20, 20;
    v4l2_streamparm: 204, 204;
}
