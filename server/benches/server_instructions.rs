//! Instructions that the server's own parts take, counted under valgrind: `make
//! bench-instructions`.
#![allow(
    missing_docs,
    unused_qualifications,
    clippy::unwrap_used,
    reason = "benches, and what their macros expand to"
)]

mod common;

use std::hint::black_box;

use common::{Waiting, Work};
use gungraun::{library_benchmark, library_benchmark_group, main};
use troupe_proto::v1;

#[library_benchmark(setup = Work::load)]
#[bench::frames_64()]
fn prepare_a_request(work: Work) -> Work {
    black_box(work.prepare());
    work
}

#[library_benchmark(setup = Work::load)]
#[bench::frames_64()]
fn finish_a_request(work: Work) -> Work {
    black_box(work.finish());
    work
}

#[library_benchmark(setup = Work::load)]
#[bench::frames_64()]
fn finish_a_request_feet_free(work: Work) -> Work {
    black_box(work.finish_free());
    work
}

#[library_benchmark(setup = Work::load)]
#[bench::frames_36()]
fn finish_a_live_plan(work: Work) -> Work {
    black_box(work.finish_live());
    work
}

#[library_benchmark(setup = Work::load)]
#[bench::characters_100()]
fn encode_a_tick(work: Work) -> Work {
    black_box(work.encode(100, v1::Encoding::Compact));
    work
}

/// A scheduler with a queue of constant length.
fn waiting(characters: usize) -> Waiting {
    let mut waiting = Waiting::of(characters);
    waiting.turn();
    waiting
}

#[library_benchmark(setup = waiting)]
#[bench::waiting_10(10)]
#[bench::waiting_1000(1000)]
#[bench::waiting_10000(10_000)]
fn scheduler_turn(mut waiting: Waiting) -> Waiting {
    black_box(waiting.turn());
    waiting
}

library_benchmark_group!(
    name = server,
    benchmarks = [
        prepare_a_request,
        finish_a_request,
        finish_a_request_feet_free,
        finish_a_live_plan,
        encode_a_tick,
        scheduler_turn
    ]
);
main!(library_benchmark_groups = server);
