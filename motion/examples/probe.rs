use std::path::Path;
use std::sync::Arc;
use troupe_motion::anatomy::PartsDoc;
use troupe_motion::fk::local_from_world_rotations;
use troupe_motion::read::{Options, Source, character, read};
use troupe_motion::retarget::{Certificate, Figure, Retargeter, retarget};
use troupe_motion::robot::{
    RobotDoc,
    description::{self, BuildOptions},
};
use troupe_motion::rotation::from_wxyz;
use troupe_motion::{Quat, Skeleton};

#[derive(serde::Deserialize)]
struct Neutral {
    rotations: Vec<[f32; 4]>,
}
#[derive(serde::Deserialize)]
struct Body {
    height_m: Option<f32>,
    neutral: Option<Neutral>,
    skeleton: Skeleton,
    robot: Option<RobotDoc>,
}

fn robot(file: &str) -> Arc<Skeleton> {
    let text = std::fs::read_to_string(file).unwrap();
    let folder = Path::new(file).parent().unwrap();
    let d = description::read(&text, &|n| troupe_motion::read::beside::mesh(folder, n)).unwrap();
    Arc::new(description::build(&d, &BuildOptions::default()).unwrap().skeleton)
}

fn body(file: &str, still: bool) -> Result<Figure, String> {
    if file.ends_with(".toml") {
        let b: Body = toml::from_str(&std::fs::read_to_string(file).unwrap()).unwrap();
        if let Some(r) = &b.robot {
            return Figure::of_robot(Arc::new(b.skeleton.with_robot(r).unwrap()), &PartsDoc::default())
                .map_err(|e| e.to_string());
        }
        let n = b.neutral.unwrap();
        let world: Vec<Quat> = n.rotations.iter().map(|r| from_wxyz(*r)).collect();
        let mut local = vec![Quat::IDENTITY; world.len()];
        local_from_world_rotations(&b.skeleton, &world, &mut local);
        return Figure::new(Arc::new(b.skeleton), &local, b.height_m, &PartsDoc::default())
            .map_err(|e| e.to_string());
    }
    if file.ends_with("urdf") || file.ends_with("xml") {
        return Figure::of_robot(robot(file), &PartsDoc::default()).map_err(|e| e.to_string());
    }
    let (file, animation) = match file.rsplit_once('#') {
        Some((f, a)) => (f, Some(a.to_owned())),
        None => (file, None),
    };
    let bytes = std::fs::read(file).unwrap();
    let s = Source::new(file, &bytes);
    let found = if still {
        character(&s, &Options::default())
    } else {
        read(
            &s,
            &Options {
                animation,
                ..Options::default()
            },
        )
    }
    .map_err(|e| e.to_string())?;
    found.figure(&PartsDoc::default()).map_err(|e| e.to_string())
}

fn feet(r: &Retargeter, clip: &troupe_motion::Clip, made: &troupe_motion::Clip) {
    let w = [clip, made].map(troupe_motion::fk::WorldMotion::from_clip);
    let [a, b] = r.figures();
    for side in [0, 1] {
        let (from, to) = (&a.parts().legs[side], &b.parts().legs[side]);
        let below: Vec<usize> = (to.end..b.skeleton().joint_count())
            .filter(|&j| {
                let mut at = Some(j);
                while let Some(x) = at {
                    if x == to.end {
                        return true;
                    }
                    at = b.skeleton().joints[x].parent;
                }
                false
            })
            .collect();
        let low = |f: usize| {
            below
                .iter()
                .map(|&j| w[1].positions_at(f)[j].y)
                .fold(9.0, f32::min)
        };
        let mut order: Vec<usize> = (0..clip.frames()).collect();
        order.sort_by(|&x, &y| low(x).total_cmp(&low(y)));
        for &f in order.iter().take(1).chain(order.iter().skip(60).take(1)) {
            let s: Vec<_> = [Some(from.end), from.toe]
                .into_iter()
                .flatten()
                .map(|j| w[0].positions_at(f)[j])
                .collect();
            let t: Vec<_> = below
                .iter()
                .map(|&j| format!("{} {:.3}", b.skeleton().joints[j].name, w[1].positions_at(f)[j]))
                .collect();
            println!(
                "      frame {f}: source {s:.3?} target {t:?} local toe {:?}",
                to.toe.map(|t| made.rotations_at(f)[t].to_scaled_axis())
            );
        }
    }
}

fn film(dir: &str, name: &str, clip: &troupe_motion::Clip, made: &troupe_motion::Clip) {
    let w = [clip, made].map(troupe_motion::fk::WorldMotion::from_clip);
    let of = |c: &troupe_motion::Clip, w: &troupe_motion::fk::WorldMotion| {
        let n = 10usize.min(c.frames());
        let frames: Vec<usize> = (0..n).map(|k| k * (c.frames() - 1) / (n - 1).max(1)).collect();
        serde_json::json!({
            "names": c.skeleton.joints.iter().map(|j| j.name.clone()).collect::<Vec<_>>(),
            "parents": c.skeleton.joints.iter().map(|j| j.parent.map_or(-1, |p| p as i64)).collect::<Vec<_>>(),
            "frames": frames,
            "places": frames.iter().map(|&f| w.positions_at(f).iter().map(|p| p.to_array()).collect::<Vec<_>>()).collect::<Vec<_>>(),
            "rotations": frames.iter().map(|&f| w.rotations_at(f).iter().map(|p| p.to_array()).collect::<Vec<_>>()).collect::<Vec<_>>(),
        })
    };
    let doc = serde_json::json!({ "source": of(clip, &w[0]), "target": of(made, &w[1]) });
    std::fs::write(format!("{dir}/{name}.json"), doc.to_string()).unwrap();
}

fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let verbose = args.iter().any(|a| a == "-v");
    let show = args.iter().any(|a| a == "-p");
    let at = args.iter().position(|a| a == "--to").unwrap();
    let clips = args.iter().position(|a| a == "--clips");
    let (from, to) = (&args[..at], &args[at + 1..clips.unwrap_or(args.len())]);
    let clips = clips.map_or(&[][..], |c| &args[c + 1..]);
    let stem = |f: &str| Path::new(f).file_stem().unwrap().to_string_lossy().into_owned();
    for f in from.iter().filter(|a| !a.starts_with('-')) {
        let source = match body(f, false) {
            Ok(b) => b,
            Err(e) => {
                println!("{f}: {e}");
                continue;
            }
        };
        if show {
            println!(
                "{f}\n{}",
                toml::to_string(&PartsDoc::of(source.parts(), source.skeleton())).unwrap()
            );
        }
        for t in to.iter().filter(|a| !a.starts_with('-')) {
            let target = match body(t, true) {
                Ok(b) => b,
                Err(e) => {
                    println!("{t}: {e}");
                    continue;
                }
            };
            if show {
                println!(
                    "{t}\n{}",
                    toml::to_string(&PartsDoc::of(target.parts(), target.skeleton())).unwrap()
                );
            }
            let mut r = match Retargeter::new(source.clone(), target) {
                Ok(r) => r,
                Err(e) => {
                    println!("{} -> {}: {e}", stem(f), stem(t));
                    continue;
                }
            };
            let c = Certificate::of(&r);
            let faults = c.faults();
            let m = |g: fn(&troupe_motion::retarget::Figures) -> f32| {
                c.trials.iter().map(|t| g(&t.figures)).fold(0.0, f32::max)
            };
            println!(
                "{} -> {}: scale {:.2} faults {} dirs {:.1} worst {:.1} lines {:.1} skate+ {:.3} under {:.3} short {:.3}",
                stem(f),
                stem(t),
                r.scale(),
                faults.len(),
                m(|f| f.directions_deg),
                m(|f| f.worst_deg),
                m(|f| f.lines_deg),
                m(|f| f.skate_mps - f.source_skate_mps),
                m(|f| f.under_m),
                m(|f| f.short_m)
            );
            if verbose {
                for t in &c.trials {
                    let g = &t.figures;
                    println!(
                        "    {:26} dirs {:.1} worst {:.1} {} lines {:.1} {} skate {:.3}/{:.3} {} under {:.3} {} short {:.3} {}",
                        t.name,
                        g.directions_deg,
                        g.worst_deg,
                        g.joints.bone,
                        g.lines_deg,
                        g.joints.line,
                        g.skate_mps,
                        g.source_skate_mps,
                        g.joints.skate,
                        g.under_m,
                        g.joints.under,
                        g.short_m,
                        g.joints.short
                    );
                }
            }
            for clip in clips {
                let (clip, animation) = match clip.rsplit_once('#') {
                    Some((f, a)) => (f.to_owned(), Some(a.to_owned())),
                    None => (clip.clone(), None),
                };
                let clip = &clip;
                let bytes = std::fs::read(clip).unwrap();
                let skeleton = clip.ends_with("csv").then(|| source.skeleton().clone());
                let o = Options {
                    skeleton,
                    animation,
                    ..Options::default()
                };
                let found = match read(&Source::new(clip, &bytes), &o) {
                    Ok(b) => b,
                    Err(e) => {
                        println!("{clip}: {e}");
                        continue;
                    }
                };
                if found.clip.skeleton.joint_count() != source.skeleton().joint_count() {
                    println!(
                        "{clip} has {} joints, body {}",
                        found.clip.skeleton.joint_count(),
                        source.skeleton().joint_count()
                    );
                    continue;
                }
                let (made, g) = retarget(&mut r, &found.clip).unwrap();
                if let Ok(dir) = std::env::var("FILM") {
                    film(&dir, &format!("{}--{}", stem(clip), stem(t)), &found.clip, &made);
                }
                if verbose {
                    feet(&r, &found.clip, &made);
                }
                println!(
                    "    {}: dirs {:.1} worst {:.1} {} skate {:.3}/{:.3} under {:.3} {} short {:.3} faults {}",
                    stem(clip),
                    g.directions_deg,
                    g.worst_deg,
                    g.joints.bone,
                    g.skate_mps,
                    g.source_skate_mps,
                    g.under_m,
                    g.joints.under,
                    g.short_m,
                    g.faults().len()
                );
            }
        }
    }
}
