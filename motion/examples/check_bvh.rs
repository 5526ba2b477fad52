//! Checks a folder of BVH clips, and reports every clip that does not load or is not fit for use,
//! with the reason.
//!
//! `cargo run --release -p troupe-motion --example check_bvh -- FOLDER [--verbose]`
//!
//! Exit code 0: all clips are fit; 1: some are not; 2: the folder cannot be read or has no clips.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::{Duration, Instant};

use troupe_motion::bvh::{self, BvhOptions};
use troupe_motion::inspect::{Limits, inspect};

fn main() -> ExitCode {
    let mut arguments: Vec<String> = std::env::args().skip(1).collect();
    let verbose = arguments.iter().any(|a| a == "--verbose");
    arguments.retain(|a| a != "--verbose");
    let [folder] = arguments.as_slice() else {
        eprintln!("usage: check_bvh FOLDER [--verbose]");
        return ExitCode::from(2);
    };
    let clips = match find_clips(Path::new(folder)) {
        Ok(clips) if clips.is_empty() => {
            eprintln!("{folder}: no BVH files");
            return ExitCode::from(2);
        }
        Ok(clips) => clips,
        Err(error) => {
            eprintln!("{folder}: {error}");
            return ExitCode::from(2);
        }
    };
    if report(&clips, verbose) {
        ExitCode::SUCCESS
    } else {
        ExitCode::from(1)
    }
}

/// All `.bvh` files below `folder`, sorted by name. Links to folders are not followed.
fn find_clips(folder: &Path) -> std::io::Result<Vec<PathBuf>> {
    let mut clips = Vec::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder)? {
            let entry = entry?;
            let path = entry.path();
            if entry.file_type()?.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("bvh")) {
                clips.push(path);
            }
        }
    }
    clips.sort();
    Ok(clips)
}

/// Prints a line for every clip with a problem, then the totals. Returns whether there was none.
fn report(clips: &[PathBuf], verbose: bool) -> bool {
    let mut totals = Totals::default();
    for path in clips {
        let reasons = check(path, &mut totals);
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        if !reasons.is_empty() {
            totals.unfit += 1;
            println!("{name}: {}", reasons.join("; "));
        } else if verbose {
            println!("{name}: ok");
        }
    }
    let per_clip = |d: Duration| d.as_secs_f64() * 1e3 / clips.len() as f64;
    println!(
        "{} clips: {} parsed, {} converted, {} unfit; {} frames, {:.2} h",
        clips.len(),
        totals.parsed,
        totals.converted,
        totals.unfit,
        totals.frames,
        totals.seconds / 3600.0
    );
    println!(
        "parse {:.2} ms a clip ({:.0} MB/s, slowest {:.1} ms), conversion {:.2} ms a clip",
        per_clip(totals.parsing),
        totals.bytes as f64 / 1e6 / totals.parsing.as_secs_f64().max(1e-9),
        totals.slowest.as_secs_f64() * 1e3,
        per_clip(totals.converting)
    );
    totals.unfit == 0
}

#[derive(Default)]
struct Totals {
    parsed: usize,
    converted: usize,
    unfit: usize,
    frames: usize,
    seconds: f64,
    bytes: usize,
    parsing: Duration,
    converting: Duration,
    slowest: Duration,
}

/// The problems of one clip.
fn check(path: &Path, totals: &mut Totals) -> Vec<String> {
    let bytes = match std::fs::read(path) {
        Ok(bytes) => bytes,
        Err(error) => return vec![format!("cannot be read: {error}")],
    };
    totals.bytes += bytes.len();
    let start = Instant::now();
    let parsed = bvh::parse_bytes(&bytes);
    let took = start.elapsed();
    totals.parsing += took;
    totals.slowest = totals.slowest.max(took);
    let file = match parsed {
        Ok(file) => file,
        Err(error) => return vec![error.to_string()],
    };
    totals.parsed += 1;
    let start = Instant::now();
    let clip = file.to_clip(&BvhOptions::default());
    totals.converting += start.elapsed();
    let clip = match clip {
        Ok(clip) => clip,
        Err(error) => return vec![error.to_string()],
    };
    totals.converted += 1;
    totals.frames += clip.frames();
    totals.seconds += f64::from(clip.duration_s());
    inspect(&clip, &Limits::default())
        .iter()
        .map(ToString::to_string)
        .collect()
}
