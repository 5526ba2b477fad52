//! Tries the retargeter: CLIP[@URDF] TARGET OUT.glb
use std::sync::Arc;
use troupe_motion::read::{Options, RestPose, Source, read};
use troupe_motion::retarget::{Figure, Retargeter, retarget};
use troupe_motion::robot::description::{self, BuildOptions};
use troupe_motion::skeleton::Skeleton;
fn robot(path: &str) -> Arc<Skeleton> {
    let text = std::fs::read_to_string(path).unwrap();
    let d = description::read(&text, &|_: &str| None).unwrap_or_else(|e| panic!("{e}"));
    Arc::new(description::build(&d, &BuildOptions::default()).unwrap_or_else(|e| panic!("{e}")).skeleton)
}
fn open(path: &str, at_rest: bool, on: Option<Arc<Skeleton>>) -> troupe_motion::read::Understood {
    let (path, animation) = path.split_once('#').map_or((path, None), |(p, a)| (p, Some(a.to_owned())));
    let bytes = std::fs::read(path).unwrap();
    let glb = path.ends_with(".glb");
    let options = Options { at_rest: at_rest && glb, skeleton: on, animation, ..Options::default() };
    read(&Source::new(path, &bytes), &options).unwrap_or_else(|e| panic!("{e}"))
}
fn show(f: &Figure) {
    let name = |j: usize| f.skeleton().joints[j].name.clone();
    let names = |js: &[usize]| js.iter().map(|&j| name(j)).collect::<Vec<_>>();
    let p = f.parts();
    println!("trunk {:?} neck {:?} tail {:?} fours {}", names(&p.trunk), names(&p.neck), names(&p.tail), p.on_fours);
    for l in p.legs.iter().chain(p.arms.iter().flatten()) { println!("  limb {:?} {:?} {:?} {} {:?}", names(&l.girdle), names(&l.upper), names(&l.lower), name(l.end), l.toe.map(name)); }
    println!("leg {}", f.leg_m());
}
fn still(s: &Arc<Skeleton>) -> Figure {
    let rest = vec![troupe_motion::Quat::IDENTITY; s.joint_count()];
    println!("{:?}", troupe_motion::ik::legs(s)); println!("{:?}", troupe_motion::ik::arms(s)); println!("{:?}", s.joints.iter().enumerate().map(|(n, j)| format!("{n}:{}<{:?}", j.name, j.parent)).collect::<Vec<_>>());
    let mut pose = rest.clone();
    if let Some(r) = &s.robot { r.pose(rest[0], &vec![0.0; r.hinges().len()], &mut pose); }
    Figure::new(Arc::clone(s), &pose, None).unwrap_or_else(|e| panic!("{e}"))
}
fn main() {
    let args: Vec<String> = std::env::args().collect();
    let (file, on) = args[1].split_once('@').map_or((&*args[1], None), |(f, u)| (f, Some(robot(u))));
    let clip = open(file, false, on.clone());
    let a = match &on {
        Some(s) => still(s),
        None if clip.report.rest_pose.value == RestPose::None && clip.neutral_pose().is_some() => Figure::of_motion(&clip.clip, clip.neutral_pose().unwrap()).unwrap_or_else(|e| panic!("{e}")),
        None => Figure::new(Arc::clone(&clip.clip.skeleton), clip.rest.as_ref().unwrap(), None).unwrap_or_else(|e| panic!("{e}")),
    };
    show(&a);
    let b = if args[2].ends_with(".urdf") { still(&robot(&args[2])) } else {
        let hero = open(&args[2], true, None);
        Figure::new(Arc::clone(&hero.clip.skeleton), hero.rest.as_ref().unwrap(), Some(hero.clip.root_positions[0].y)).unwrap_or_else(|e| panic!("{e}"))
    };
    show(&b);
    let mut r = Retargeter::new(a, b).unwrap_or_else(|e| panic!("{e}"));
    let cut = clip.clip.slice(0..clip.clip.frames().min(400)).unwrap();
    let start = std::time::Instant::now();
    let (out, figures) = retarget(&mut r, &cut).unwrap();
    println!("{:.1} µs a frame", start.elapsed().as_secs_f64() * 1e6 / out.frames() as f64);
    println!("{figures:?}\n{:?}", figures.faults());
    std::fs::write(&args[3], troupe_motion::glb::write_glb(&out).unwrap()).unwrap();
}
