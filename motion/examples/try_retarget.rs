//! Tries the retargeter: CLIP[@URDF] TARGET OUT.glb
use std::sync::Arc;
use troupe_motion::anatomy::PartsDoc;
use troupe_motion::read::{Options, Source, Understood, character, read};
use troupe_motion::retarget::{Figure, Retargeter, retarget};
use troupe_motion::robot::description::{self, BuildOptions};
use troupe_motion::skeleton::Skeleton;
fn robot(path: &str) -> Arc<Skeleton> {
    let text = std::fs::read_to_string(path).unwrap();
    let d = description::read(&text, &|_: &str| None).unwrap_or_else(|e| panic!("{e}"));
    Arc::new(
        description::build(&d, &BuildOptions::default())
            .unwrap_or_else(|e| panic!("{e}"))
            .skeleton,
    )
}
fn open(path: &str, still: bool, on: Option<Arc<Skeleton>>) -> Understood {
    let (path, animation) = path
        .split_once('#')
        .map_or((path, None), |(p, a)| (p, Some(a.to_owned())));
    let bytes = std::fs::read(path).unwrap();
    let options = Options {
        skeleton: on,
        animation,
        ..Options::default()
    };
    let found = if still {
        character(&Source::new(path, &bytes), &options)
    } else {
        read(&Source::new(path, &bytes), &options)
    };
    found.unwrap_or_else(|e| panic!("{e}"))
}
fn show(f: &Figure) {
    println!("{:?} leg {}", PartsDoc::of(f.parts(), f.skeleton()), f.leg_m());
}
fn main() {
    let args: Vec<String> = std::env::args().collect();
    let (file, on) = args[1]
        .split_once('@')
        .map_or((&*args[1], None), |(f, u)| (f, Some(robot(u))));
    let clip = open(file, false, on);
    let none = PartsDoc::default();
    let a = clip.figure(&none).unwrap_or_else(|e| panic!("{e}"));
    show(&a);
    let mut bytes = None;
    let b = if args[2].ends_with(".urdf") {
        let s = robot(&args[2]);
        let mut pose = vec![troupe_motion::Quat::IDENTITY; s.joint_count()];
        if let Some(r) = &s.robot {
            r.pose(pose[0], &vec![0.0; r.hinges().len()], &mut pose);
        }
        Figure::new(s, &pose, None, &none).unwrap_or_else(|e| panic!("{e}"))
    } else {
        bytes = std::fs::read(&args[2]).ok();
        open(&args[2], true, None)
            .figure(&none)
            .unwrap_or_else(|e| panic!("{e}"))
    };
    show(&b);
    let mut r = Retargeter::new(a, b).unwrap_or_else(|e| panic!("{e}"));
    let cut = clip.clip.slice(0..clip.clip.frames().min(400)).unwrap();
    let start = std::time::Instant::now();
    let (out, figures) = retarget(&mut r, &cut).unwrap();
    println!(
        "{:.1} µs a frame",
        start.elapsed().as_secs_f64() * 1e6 / out.frames() as f64
    );
    println!("{figures:?}\n{:?}", figures.faults());
    let made = match bytes {
        Some(b) => troupe_motion::glb::add_animation(&b, &out, "walk").unwrap_or_else(|e| panic!("{e}")),
        None => troupe_motion::glb::write_glb(&out).unwrap(),
    };
    std::fs::write(&args[3], made).unwrap();
    if args[3].ends_with(".glb") {
        let again = open(&args[3], false, None);
        let w = [&again.clip, &out].map(troupe_motion::fk::WorldMotion::from_clip);
        let names = |c: &troupe_motion::Clip| {
            c.skeleton
                .joints
                .iter()
                .map(|j| j.name.clone())
                .collect::<Vec<_>>()
        };
        let (na, nb) = (names(&again.clip), names(&out));
        let mut worst = 0.0f32;
        for f in 0..out.frames() {
            for (j, n) in nb.iter().enumerate() {
                if let Some(k) = na.iter().position(|m| m == n) {
                    worst = worst.max(w[0].positions_at(f)[k].distance(w[1].positions_at(f)[j]));
                }
            }
        }
        println!("read back: {worst} m");
    }
}
