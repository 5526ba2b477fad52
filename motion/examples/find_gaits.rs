//! Lists the best gait of every BVH file in a folder:
//! `cargo run -p troupe-motion --example find_gaits -- PACK.toml FOLDER [PART-OF-NAME]`.

use std::path::Path;
use std::sync::Arc;

use serde::Deserialize;
use troupe_motion::bvh::{BvhOptions, parse_bytes};
use troupe_motion::gait::{CycleOptions, Way, find_cycles, find_stand};
use troupe_motion::{Clip, Skeleton};

#[derive(Deserialize)]
struct Manifest {
    skeleton: Skeleton,
}

fn read(path: &Path, skeleton: &Arc<Skeleton>) -> Result<Clip, Box<dyn std::error::Error>> {
    let file = parse_bytes(&std::fs::read(path)?)?;
    Ok(file.to_clip_on(skeleton, &BvhOptions::default())?)
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [pack, folder, part @ ..] = &arguments[..] else {
        return Err("usage: find_gaits PACK.toml FOLDER [PART-OF-NAME]".into());
    };
    let manifest: Manifest = toml::from_str(&std::fs::read_to_string(pack)?)?;
    let skeleton = Arc::new(manifest.skeleton);
    let mut paths: Vec<_> = std::fs::read_dir(folder)?
        .map(|e| e.map(|e| e.path()))
        .collect::<Result<_, _>>()?;
    paths.retain(|p| p.extension().is_some_and(|e| e == "bvh"));
    paths.retain(|p| {
        part.first()
            .is_none_or(|part| p.to_string_lossy().contains(part.as_str()))
    });
    paths.sort();
    for path in paths {
        let name = path.file_stem().unwrap_or_default().to_string_lossy();
        let clip = read(&path, &skeleton)?;
        for way in [Way::Straight, Way::Turning] {
            let options = CycleOptions {
                way,
                ..CycleOptions::default()
            };
            match find_cycles(&clip, &options) {
                Ok(cycles) => {
                    let c = cycles[0];
                    println!(
                        "{name} {way:?} start {} frames {} left {:.2} forward {:.2} turn {:.2} height {:.3} closure {:.3} of {}",
                        c.start,
                        c.frames,
                        c.left_mps,
                        c.forward_mps,
                        c.turn_rps,
                        c.height_m,
                        c.closure_m,
                        cycles.len()
                    );
                }
                Err(e) => println!("{name} {way:?} error: {e}"),
            }
        }
        match find_stand(&clip, &Default::default()) {
            Ok(s) => println!(
                "{name} Stand frame {} speed {:.2} height {:.3}",
                s.frame, s.speed_mps, s.height_m
            ),
            Err(e) => println!("{name} Stand error: {e}"),
        }
    }
    Ok(())
}
