use std::path::Path;
use std::sync::Arc;
use troupe_motion::read::{Options, Source, read};
use troupe_motion::retarget::{Figure, Retargeter, retarget};
fn open(path: &str, at_rest: bool) -> troupe_motion::read::Understood {
    let bytes = std::fs::read(path).unwrap();
    let glb = path.ends_with(".glb");
    let options = Options { at_rest: at_rest && glb, ..Options::default() };
    let found = read(&Source::new(path, &bytes), &options).unwrap_or_else(|e| panic!("{e}"));
    for [a, b, c] in found.report.rows() { println!("  {a}: {b} ({c})"); }
    found
}
fn main() {
    let args: Vec<String> = std::env::args().collect();
    let clip = open(&args[1], false);
    let hero = open(&args[2], true);
    let figure = |u: &troupe_motion::read::Understood, root: bool| {
        let rest = u.rest.clone().unwrap();
        let f = if u.report.rest_pose.value == troupe_motion::read::RestPose::None { Figure::of_motion(&u.clip, u.neutral_pose().unwrap()).unwrap_or_else(|e| panic!("{e}")) } else { Figure::new(Arc::clone(&u.clip.skeleton), &rest, root.then(|| u.clip.root_positions[0].y)).unwrap_or_else(|e| panic!("{e}")) };
        let name = |j: usize| u.clip.skeleton.joints[j].name.clone();
        let p = f.parts();
        println!("trunk {:?} neck {:?} tail {:?} fours {}", p.trunk.iter().map(|&j| name(j)).collect::<Vec<_>>(), p.neck.iter().map(|&j| name(j)).collect::<Vec<_>>(), p.tail.len(), p.on_fours);
        for l in p.legs.iter().chain(p.arms.iter().flatten()) { println!("  limb {:?} {:?} {:?} {} {:?}", l.girdle.iter().map(|&j| name(j)).collect::<Vec<_>>(), l.upper.iter().map(|&j| name(j)).collect::<Vec<_>>(), l.lower.iter().map(|&j| name(j)).collect::<Vec<_>>(), name(l.end), l.toe.map(name)); }
        println!("leg {}", f.leg_m());
        f
    };
    let (a, b) = (figure(&clip, false), figure(&hero, true));
    let mut r = Retargeter::new(a, b).unwrap();
    let start = std::time::Instant::now();
    let (out, figures) = retarget(&mut r, &clip.clip).unwrap();
    println!("{:.1} µs a frame, short {}", start.elapsed().as_secs_f64() * 1e6 / out.frames() as f64, r.short_m());
    println!("{figures:?}\n{:?}", figures.faults());
    std::fs::write(Path::new(&args[3]), troupe_motion::glb::write_glb(&out).unwrap()).unwrap();
}
