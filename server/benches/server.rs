//! Times of the server's own parts: `cargo bench -p troupe-server --bench server`.
#![allow(missing_docs, clippy::unwrap_used, reason = "benches")]

mod common;

use common::{Waiting, Work};
use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use troupe_proto::v1;

fn requests(criterion: &mut Criterion) {
    let work = Work::load();
    let mut group = criterion.benchmark_group("server/64 frames");
    group.bench_function("prepare a request", |b| b.iter(|| work.prepare()));
    group.bench_function("finish a request", |b| b.iter(|| work.finish()));
    group.bench_function("finish a request, feet free", |b| b.iter(|| work.finish_free()));
    group.bench_function("finish a live plan", |b| b.iter(|| work.finish_live()));
    group.finish();
}

fn frames(criterion: &mut Criterion) {
    let work = Work::load();
    let mut group = criterion.benchmark_group("server/encode a tick");
    for characters in [1, 100, 1000] {
        group.throughput(Throughput::Elements(characters as u64));
        for (name, encoding) in [("f32", v1::Encoding::F32), ("compact", v1::Encoding::Compact)] {
            group.bench_with_input(BenchmarkId::new(name, characters), &characters, |b, &count| {
                b.iter(|| work.encode(count, encoding));
            });
        }
    }
    group.finish();
}

fn scheduler(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("server/scheduler turn");
    for characters in [10, 1000, 10_000] {
        let mut waiting = Waiting::of(characters);
        group.throughput(Throughput::Elements(waiting.turn() as u64));
        group.bench_function(BenchmarkId::new("waiting", characters), |b| {
            b.iter(|| waiting.turn())
        });
    }
    group.finish();
}

criterion_group!(benches, requests, frames, scheduler);
criterion_main!(benches);
