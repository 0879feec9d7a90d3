//! Tells the linker each image's memory map, and links again when a map changes.

use std::env;

/// Images for other boards than the one that `memory.x` is about, and their maps.
const MAPS: [(&str, &str); 3] =
    [("device", "mps2/megabytes.x"), ("stages", "mps2/megabytes.x"), ("selftest", "mps2/small.x")];

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-changed=../memory.x");
    println!("cargo:rerun-if-changed=src/board");
    let set = |name: &str| env::var_os(name).is_some();
    if env::var("CARGO_CFG_TARGET_OS").as_deref() != Ok("none") {
        return;
    }
    let folder = env::var("CARGO_MANIFEST_DIR").expect("cargo sets it") + "/..";
    // memory.x is found in the project's root, where the linker runs; said for those who build elsewhere.
    println!("cargo:rustc-link-search={folder}");
    if set("CARGO_FEATURE_MPS2") {
        for (image, map) in MAPS {
            println!("cargo:rustc-link-arg-bin={image}=-T{folder}/firmware/src/board/{map}");
        }
    }
    // After the map: what is not defined yet is taken for undefined.
    println!("cargo:rustc-link-arg-bins=-Tlink.x");
    if set("CARGO_FEATURE_H743") {
        println!("cargo:rustc-link-arg-bin=camera=-Tdefmt.x");
    }
}
