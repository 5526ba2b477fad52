//! Names the shared library, so that programs find it by name rather than by the path at which they
//! were linked.

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    let name = match std::env::var("CARGO_CFG_TARGET_OS").as_deref() {
        Ok("linux" | "android" | "freebsd") => "-Wl,-soname,libtroupe_c.so",
        Ok("macos" | "ios") => "-Wl,-install_name,@rpath/libtroupe_c.dylib",
        _ => return,
    };
    println!("cargo::rustc-cdylib-link-arg={name}");
}
