//! The shared libraries that a GPU's provider of ONNX Runtime needs: found, loaded, or named.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use libloading::os::unix::{Library, RTLD_GLOBAL, RTLD_NOW};
use object::read::elf::{Dyn as _, ElfFile64};
use object::{Endianness, ReadCache, elf};

use crate::EngineKind;

/// cuDNN, which providers open while they run: without it they load, and fail at the first network.
/// The second one needs most of its other parts.
const OPENED_LATER: [&str; 2] = ["libcudnn.so.9", "libcudnn_ops.so.9"];
/// The driver's own library. It comes from nowhere else.
const DRIVER: &str = "libcuda.so.1";
/// Environment variable of folders that the dynamic linker searches first.
const LINKER_VARIABLE: &str = "LD_LIBRARY_PATH";

/// The provider's file beside ONNX Runtime. None for engines whose libraries are not looked for.
fn file_name(engine: EngineKind) -> Option<&'static str> {
    match engine {
        EngineKind::Cpu | EngineKind::OpenvinoBf16 => None,
        EngineKind::Cuda => Some("libonnxruntime_providers_cuda.so"),
        EngineKind::Tensorrt => Some("libonnxruntime_providers_tensorrt.so"),
    }
}

/// Loads what the provider of `engine` needs into the process: from the folder of ONNX Runtime, or
/// from where the dynamic linker finds it. Later users of the same names get these.
///
/// # Errors
/// A text that names each library that is missing, the places that were searched, and the way on.
pub(super) fn load_needed(onnx_runtime: &Path, engine: EngineKind) -> Result<(), String> {
    let Some(name) = file_name(engine) else {
        return Ok(());
    };
    let folder = onnx_runtime.parent().unwrap_or(Path::new("."));
    let provider = folder.join(name);
    let mut needed = needed(&provider)
        .map_err(|why| format!("the provider {} cannot be read: {why}", provider.display()))?;
    needed.extend(OPENED_LATER.map(str::to_owned));
    needed.dedup();
    let mut missing = Vec::new();
    for library in needed {
        if let Err(why) = load(folder, &library) {
            tracing::debug!(library, why, "a GPU's library does not load");
            missing.push(library);
        }
    }
    match missing.is_empty() {
        true => Ok(()),
        false => Err(complaint(&missing, folder)),
    }
}

/// Loads a library for good, with its names for those that come later.
fn load(folder: &Path, name: &str) -> Result<(), String> {
    let beside: PathBuf = folder.join(name);
    let places = [
        beside.is_file().then(|| beside.into_os_string()),
        Some(name.into()),
    ];
    let mut error = String::new();
    for place in places.into_iter().flatten() {
        // SAFETY: what libraries of the driver and of CUDA do when they are loaded is no more than
        // what they do when ONNX Runtime loads them.
        #[expect(unsafe_code, reason = "loading a library runs its code")]
        let opened = unsafe { Library::open(Some(&place), RTLD_NOW | RTLD_GLOBAL) };
        match opened {
            Ok(library) => {
                std::mem::forget(library);
                return Ok(());
            }
            Err(why) => error = why.to_string(),
        }
    }
    Err(error)
}

/// The names of libraries in a library's dynamic section.
fn needed(file: &Path) -> Result<Vec<String>, String> {
    let file = std::fs::File::open(file).map_err(|error| error.to_string())?;
    // Some have hundreds of megabytes: only what is looked at is read.
    let bytes = ReadCache::new(file);
    let parse = || -> object::Result<Vec<String>> {
        let elf = ElfFile64::<Endianness, _>::parse(&bytes)?;
        let endian = elf.endian();
        let sections = elf.elf_section_table();
        let Some((entries, link)) = sections.dynamic(endian, &bytes)? else {
            return Ok(Vec::new());
        };
        let strings = sections.strings(endian, &bytes, link)?;
        let libraries = entries.iter().filter(|entry| entry.tag(endian) == elf::DT_NEEDED);
        let names = libraries.map(|entry| entry.string(endian, strings));
        let names: Vec<&[u8]> = names.collect::<object::Result<_>>()?;
        Ok(names
            .into_iter()
            .map(|name| String::from_utf8_lossy(name).into_owned())
            .collect())
    };
    parse().map_err(|error| error.to_string())
}

fn complaint(missing: &[String], folder: &Path) -> String {
    let (driver, cuda): (Vec<&String>, Vec<&String>) = missing.iter().partition(|name| *name == DRIVER);
    let mut text = String::new();
    if !driver.is_empty() {
        let _ = write!(text, "{DRIVER} is missing: it comes with NVIDIA's driver. ");
    }
    if !cuda.is_empty() {
        let names: Vec<&str> = cuda.iter().map(|name| name.as_str()).collect();
        let verb = if names.len() == 1 { "is" } else { "are" };
        let _ = write!(
            text,
            "{} {verb} missing: CUDA 13 and cuDNN 9, with `TROUPE_RUNTIME=gpu make runtime` or from the system; TensorRT 10 from \
             the system alone. ",
            names.join(", ")
        );
    }
    let path = std::env::var(LINKER_VARIABLE).unwrap_or_default();
    let path = if path.is_empty() { "empty" } else { &path };
    let _ = write!(
        text,
        "Looked in {}, in {LINKER_VARIABLE} ({path}) and in the folders of /etc/ld.so.conf",
        folder.display()
    );
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folder(name: &str) -> PathBuf {
        let folder = std::env::temp_dir().join(format!("troupe-provider-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        folder
    }

    /// A library that needs another one, which is beside it or nowhere.
    fn provider(folder: &Path, keeps: bool) {
        let compile = |arguments: &[&str]| {
            let mut compiler = std::process::Command::new("cc");
            let done = compiler.current_dir(folder).args(arguments).status().unwrap();
            assert!(done.success(), "{arguments:?}");
        };
        for (source, text) in [
            ("a.c", "int a(void) { return 1; }"),
            ("b.c", "int a(void); int b(void) { return a(); }"),
        ] {
            std::fs::write(folder.join(source), text).unwrap();
        }
        let soname = format!("libtroupe-{}.so.7", if keeps { "here" } else { "nowhere" });
        let named = format!("-Wl,-soname,{soname}");
        compile(&["-shared", "-fPIC", "-nostdlib", &named, "a.c", "-o", &soname]);
        let out = "libonnxruntime_providers_cuda.so";
        compile(&[
            "-shared",
            "-fPIC",
            "-nostdlib",
            "-Wl,--no-as-needed",
            "b.c",
            &soname,
            "-o",
            out,
        ]);
        if !keeps {
            std::fs::remove_file(folder.join(soname)).unwrap();
        }
    }

    #[test]
    fn each_library_that_is_missing_is_named_with_where_it_was_looked_for() {
        let folder = folder("missing");
        provider(&folder, false);
        let error = load_needed(&folder.join("libonnxruntime.so"), EngineKind::Cuda).unwrap_err();
        assert!(error.contains("libtroupe-nowhere.so.7"), "{error}");
        assert!(
            error.contains(&folder.display().to_string()) && error.contains(LINKER_VARIABLE),
            "{error}"
        );
        assert!(error.contains("TROUPE_RUNTIME=gpu make runtime"), "{error}");
        std::fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn a_library_beside_onnx_runtime_is_found() {
        let folder = folder("found");
        provider(&folder, true);
        assert_eq!(
            needed(&folder.join("libonnxruntime_providers_cuda.so")).unwrap(),
            ["libtroupe-here.so.7"]
        );
        assert_eq!(load(&folder, "libtroupe-here.so.7"), Ok(()));
        std::fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn a_missing_driver_is_named_as_such() {
        let text = complaint(&[DRIVER.to_owned()], Path::new("/lib"));
        assert!(
            text.starts_with("libcuda.so.1 is missing: it comes with NVIDIA's driver. Looked in /lib"),
            "{text}"
        );
    }

    #[test]
    fn a_file_that_is_no_library_is_refused() {
        let folder = folder("broken");
        std::fs::write(folder.join("libonnxruntime_providers_cuda.so"), b"no library").unwrap();
        let error = load_needed(&folder.join("libonnxruntime.so"), EngineKind::Cuda).unwrap_err();
        assert!(error.contains("cannot be read"), "{error}");
        std::fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn engines_of_the_cpu_need_nothing() {
        for engine in [EngineKind::Cpu, EngineKind::OpenvinoBf16] {
            assert_eq!(load_needed(Path::new("/nowhere/lib.so"), engine), Ok(()));
        }
    }
}
