//! Time that the pure parts take for a segment of 64 frames, and that retargeting takes a frame:
//! `cargo bench -p troupe-motion --bench motion`.
#![allow(missing_docs, clippy::unwrap_used, reason = "benches")]

mod common;

use common::Segment;
use common::characters::Carried;
use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use troupe_motion::retarget::Certificate;

fn segment(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("motion/64 frames");
    let mut segment = Segment::load();
    group.throughput(Throughput::Elements(segment.clip.frames() as u64));
    group.bench_function("codec encode", |b| b.iter(|| segment.encode()));
    group.bench_function("codec decode", |b| b.iter(|| segment.decode()));
    group.bench_function("forward kinematics", |b| b.iter(|| segment.kinematics()));
    group.bench_function("6D to parent-relative", |b| b.iter(|| segment.parent_relative()));
    group.bench_function("pose features", |b| b.iter(|| segment.features()));
    group.bench_function("interpolate", |b| b.iter(|| segment.interpolate()));
    group.bench_function("pin poses", |b| b.iter(|| segment.pin()));
    group.finish();
}

fn retarget(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("motion/retarget a frame");
    let clip = Segment::load().clip;
    let (mut character, mut robot) = (Carried::to_character(&clip), Carried::to_robot(&clip));
    group.throughput(Throughput::Elements(1));
    group.bench_function("to 66 joints", |b| b.iter(|| character.next()));
    group.bench_function("to a robot", |b| b.iter(|| robot.next()));
    group.finish();
    let mut group = criterion.benchmark_group("motion/certificate");
    group.bench_function("of 66 joints", |b| {
        b.iter(|| Certificate::of(character.retargeter()))
    });
    group.finish();
}

criterion_group!(benches, segment, retarget);
criterion_main!(benches);
