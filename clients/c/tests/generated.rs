//! What is made from the sources of this crate, and kept with them, is as the sources would make it
//! now: the header for C, and the imports for C#. `TROUPE_WRITE=1` writes it.

use std::path::{Path, PathBuf};

/// Checks a file, or writes it.
fn check(path: &Path, made: &str) {
    if std::env::var_os("TROUPE_WRITE").is_some() {
        std::fs::write(path, made).expect("the file can be written");
    }
    let kept = std::fs::read_to_string(path).unwrap_or_default();
    assert!(
        kept == made,
        "{} is not up to date: TROUPE_WRITE=1 cargo test -p troupe-c --test generated",
        path.display()
    );
}

fn home() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

#[test]
fn the_header_is_what_cbindgen_makes() {
    let config = cbindgen::Config::from_file(home().join("cbindgen.toml")).unwrap();
    let mut sources = cbindgen::Builder::new().with_config(config);
    for source in sources_of_crate() {
        sources = sources.with_src(source);
    }
    let mut made = Vec::new();
    sources.generate().unwrap().write(&mut made);
    check(
        &home().join("include/troupe.h"),
        &String::from_utf8(made).unwrap(),
    );
}

#[test]
fn the_imports_of_csharp_are_what_csbindgen_makes() {
    let mut sources = csbindgen::Builder::default();
    for source in sources_of_crate() {
        sources = sources.input_extern_file(source);
    }
    let made = std::env::temp_dir().join(format!("troupe-{}.cs", std::process::id()));
    sources
        .csharp_dll_name("troupe_c")
        .csharp_dll_name_if("UNITY_IOS && !UNITY_EDITOR", "__Internal")
        .csharp_namespace("Troupe.Native")
        .csharp_class_name("Api")
        .csharp_class_accessibility("public")
        .csharp_use_nint_types(false)
        .csharp_generate_const_filter(|name| name.starts_with("TROUPE_"))
        .always_included_types(["TroupeClock", "TroupeRotation"])
        .generate_csharp_file(&made)
        .unwrap();
    let text = std::fs::read_to_string(&made).unwrap();
    std::fs::remove_file(&made).unwrap();
    check(&home().join("../unity/Runtime/Native/Api.g.cs"), &text);
}

/// The files with what C sees, in the order of the header.
fn sources_of_crate() -> Vec<PathBuf> {
    let files = [
        "lib.rs",
        "status.rs",
        "connection.rs",
        "pack.rs",
        "crowd/options.rs",
        "crowd/mod.rs",
        "crowd/columns.rs",
        "crowd/notes.rs",
        "crowd/commands.rs",
    ];
    files.iter().map(|file| home().join("src").join(file)).collect()
}
