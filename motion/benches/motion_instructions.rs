//! Instructions that the pure parts take for a segment of 64 frames, counted under valgrind:
//! `make bench-instructions`.
#![allow(
    missing_docs,
    unused_qualifications,
    clippy::unwrap_used,
    reason = "benches, and what their macros expand to"
)]

mod common;

use std::hint::black_box;

use common::Segment;
use gungraun::{library_benchmark, library_benchmark_group, main};

/// A segment on which every operation has run once, so that nothing allocates memory any more.
fn warm() -> Segment {
    let mut segment = Segment::load();
    segment.encode();
    segment.decode();
    segment
}

#[library_benchmark(setup = warm)]
#[bench::frames_64()]
fn codec_encode(mut segment: Segment) -> (usize, Segment) {
    (black_box(segment.encode()), segment)
}

#[library_benchmark(setup = warm)]
#[bench::frames_64()]
fn codec_decode(mut segment: Segment) -> (usize, Segment) {
    (black_box(segment.decode()), segment)
}

#[library_benchmark(setup = warm)]
#[bench::frames_64()]
fn forward_kinematics(mut segment: Segment) -> Segment {
    black_box(segment.kinematics());
    segment
}

#[library_benchmark(setup = warm)]
#[bench::frames_64()]
fn six_d_to_parent_relative(mut segment: Segment) -> Segment {
    black_box(segment.parent_relative());
    segment
}

#[library_benchmark(setup = warm)]
#[bench::frames_64()]
fn pose_features(mut segment: Segment) -> Segment {
    black_box(segment.features());
    segment
}

#[library_benchmark(setup = warm)]
#[bench::frames_64()]
fn interpolate(mut segment: Segment) -> Segment {
    black_box(segment.interpolate());
    segment
}

#[library_benchmark(setup = warm)]
#[bench::frames_64()]
fn pin_poses(mut segment: Segment) -> Segment {
    black_box(segment.pin());
    segment
}

library_benchmark_group!(
    name = motion,
    benchmarks = [
        codec_encode,
        codec_decode,
        forward_kinematics,
        six_d_to_parent_relative,
        pose_features,
        interpolate,
        pin_poses
    ]
);
main!(library_benchmark_groups = motion);
