//! Makes a run's report from its records and scrapes.

use super::types::{
    ByPriority, ClientFigures, Counts, Figures, LiveFigures, Percentiles, Run, SecondRow, ServerFigures,
    ServerRow, Split, StageResult, StageTimes, Throughput,
};
use crate::measure::{Harvest, LiveHarvest, Metrics, Scrape, Scrapes, Tally};
use crate::plan::Plan;

/// The input of a run's report.
#[derive(Debug, Clone, Default)]
pub struct Ingredients {
    /// The records of all processes.
    pub harvest: Harvest,
    /// Scrapes of the server's metrics, if it has any.
    pub scrapes: Option<Scrapes>,
    /// The server's resident memory before the load, bytes.
    pub rss_before_bytes: u64,
}

/// The report of a run.
pub fn run(plan: &Plan, of: &Ingredients) -> Run {
    let harvest = &of.harvest;
    let ends = of.scrapes.as_ref().and_then(Scrapes::ends);
    let sessions = harvest.live.as_ref().map_or(0, |live| live.characters);
    let figures = Figures {
        measured_s: plan.measured_s,
        counts: counts(&harvest.total),
        throughput: throughput(plan, harvest),
        latency_ms: (&harvest.total.latency).into(),
        send_lag_ms: (&harvest.send_lag).into(),
        late_sends: harvest.late_sends,
        in_flight_max: harvest
            .seconds
            .iter()
            .map(|s| s.in_flight)
            .max()
            .unwrap_or_default(),
        verified: harvest.verified,
        client: ClientFigures {
            cpu_s: harvest.own.cpu_s,
            cpus_busy: harvest.own.cpu_s / plan.measured_s,
            peak_rss_bytes: harvest.own.peak_rss_bytes(),
            processes: harvest.own.processes,
        },
        split_ms: split(harvest),
        server: ends.map(|(first, last)| server(first, last, of, sessions)),
        live: harvest.live.as_ref().map(|live| live_figures(plan, live)),
    };
    Run {
        figures,
        engine: ends
            .and_then(|(_, last)| last.metrics.label("troupe_engine_info", "engine"))
            .unwrap_or_default()
            .to_owned(),
        codes: harvest.codes.clone(),
        examples: harvest.examples.clone(),
        stages: stages(plan, harvest),
        series: series(plan, harvest),
        server_series: server_series(plan, of),
        batch_sizes: batch_sizes(harvest, ends),
        latencies: harvest.total.latency.clone(),
        fine: harvest.fine.clone(),
    }
}

fn counts(of: &Tally) -> Counts {
    Counts {
        right: of.right,
        refused: of.refused,
        failed: of.failed,
        dropped: of.dropped,
    }
}

fn throughput(plan: &Plan, harvest: &Harvest) -> Throughput {
    let done = &harvest.done;
    let per_s = |count: u64| count as f64 / plan.measured_s;
    Throughput {
        requests_per_s: per_s(done.requests),
        characters_per_s: per_s(done.characters),
        frames_per_s: per_s(done.frames),
        bytes_per_s: per_s(done.bytes),
    }
}

/// The parts of the mean latency. None if the answers have no timing.
fn split(harvest: &Harvest) -> Option<Split> {
    let timing = &harvest.timing;
    if timing.count == 0 {
        return None;
    }
    let count = timing.count as f64;
    let ms = |us: u64| us as f64 / count / 1e3;
    let inside = timing.queue_us + timing.assemble_us + timing.inference_us + timing.scatter_us;
    Some(Split {
        client: harvest.send_lag.mean_ms(),
        transport: ms(harvest.on_the_way_us.saturating_sub(timing.total_us)),
        server_other: ms(timing.total_us.saturating_sub(inside)),
        queue: ms(timing.queue_us),
        assemble: ms(timing.assemble_us),
        inference: ms(timing.inference_us),
        scatter: ms(timing.scatter_us),
    })
}

const RSS: &str = "process_resident_memory_bytes";
const CPU: &str = "process_cpu_seconds_total";

fn rss(metrics: &Metrics) -> u64 {
    metrics.sum(RSS, &[]).unwrap_or(0.0) as u64
}

fn server(first: &Scrape, last: &Scrape, of: &Ingredients, sessions: u64) -> ServerFigures {
    let seconds = last.at_s - first.at_s;
    let (now, before) = (&last.metrics, &first.metrics);
    let grown = |name: &str, labels: &[(&str, &str)]| now.grown(before, name, labels).unwrap_or(0.0);
    let mean = |name: &str, labels: &[(&str, &str)]| now.mean(before, name, labels);
    let mean_ms = |name: &str, labels: &[(&str, &str)]| mean(name, labels).map_or(0.0, |(s, _)| s * 1e3);
    let (batch_mean, batches) = mean("troupe_batch_size", &[]).unwrap_or_default();
    let stage = |name| mean_ms("troupe_inference_duration_seconds", &[("stage", name)]);
    let interval = |priority| {
        mean("troupe_plan_interval_frames", &[("priority", priority)]).map_or(0.0, |(frames, _)| frames)
    };
    let cpu_s = grown(CPU, &[]);
    // Scatter has a sample for each batch and for each request, so only the sum gives the time.
    let busy = [
        "troupe_assemble_duration_seconds_sum",
        "troupe_inference_duration_seconds_sum",
        "troupe_scatter_duration_seconds_sum",
    ];
    let all = of.scrapes.as_ref().map(|s| s.all.as_slice()).unwrap_or_default();
    let most = |value: fn(&Metrics) -> f64| all.iter().map(|s| value(&s.metrics)).fold(0.0, f64::max);
    let rss_end = rss(now);
    let per_session = rss_end.saturating_sub(of.rss_before_bytes) as f64 / sessions.max(1) as f64;
    ServerFigures {
        cpu_s,
        cpus_busy: cpu_s / seconds,
        rss_before_bytes: of.rss_before_bytes,
        rss_end_bytes: rss_end,
        rss_peak_bytes: most(|m| rss(m) as f64) as u64,
        rss_per_session_bytes: if sessions > 0 { per_session } else { 0.0 },
        request_ms: mean_ms("troupe_request_duration_seconds", &[("rpc", "InBetween")]),
        queue_ms: mean_ms("troupe_queue_duration_seconds", &[]),
        batches,
        batch_mean,
        padding: mean("troupe_batch_padding_ratio", &[]).map_or(0.0, |(share, _)| share),
        stage_ms: StageTimes {
            assemble: mean_ms("troupe_assemble_duration_seconds", &[]),
            root: stage("root"),
            pose: stage("pose"),
            decoder: stage("decoder"),
            scatter: grown("troupe_scatter_duration_seconds_sum", &[]) * 1e3 / batches.max(1.0),
        },
        workers: now.sum("troupe_engine_workers", &[]).unwrap_or(0.0),
        busy_workers: busy.iter().map(|name| grown(name, &[])).sum::<f64>() / seconds,
        rejections: grown("troupe_rejections_total", &[]),
        frames_generated_per_s: grown("troupe_frames_generated_total", &[]) / seconds,
        replans_per_s: grown("troupe_replans_total", &[]) / seconds,
        underruns: grown("troupe_underruns_total", &[]),
        late_plans: grown("troupe_late_plans_total", &[]),
        pressure_max: most(|m| m.sum("troupe_crowd_pressure", &[]).unwrap_or(0.0)),
        plan_interval_frames: ByPriority {
            low: interval("low"),
            middle: interval("middle"),
            high: interval("high"),
        },
    }
}

fn live_figures(plan: &Plan, live: &LiveHarvest) -> LiveFigures {
    LiveFigures {
        characters: live.characters,
        streams: live.streams,
        late_ticks: live.late_ticks,
        missed_ticks: live.missed_ticks,
        missing_frames: live.missing_frames,
        slowed_frames: live.slowed_frames,
        commands: live.commands,
        faults: live.faults,
        jitter_ms: (&live.jitter).into(),
        command_to_motion_ms: (&live.command_to_motion).into(),
        command_to_motion_count: live.command_to_motion.count(),
        plans: live.plans,
        performances: live.performances,
        plans_per_s_and_character: live.plans.plans() as f64
            / plan.measured_s
            / live.characters.max(1) as f64,
    }
}

fn stages(plan: &Plan, harvest: &Harvest) -> Vec<StageResult> {
    let stages = plan.stages().into_iter().flat_map(|stages| stages.iter());
    stages
        .zip(&harvest.stages)
        .map(|(stage, tally)| StageResult {
            stage: stage.to_string(),
            seconds: stage.seconds,
            counts: counts(tally),
            right_per_s: tally.right as f64 / stage.seconds,
            latency_ms: Percentiles::from(&tally.latency),
        })
        .collect()
}

fn series(plan: &Plan, harvest: &Harvest) -> Vec<SecondRow> {
    let seconds = harvest.seconds.iter().enumerate();
    seconds
        .map(|(index, of)| SecondRow {
            t: index as f64 - plan.warmup_s,
            right: of.right,
            refused: of.refused,
            failed: of.failed,
            dropped: of.dropped,
            characters: of.characters,
            frames: of.frames,
            slowed: of.underruns,
            in_flight: of.in_flight,
            p50_ms: of.latency.quantile_ms(0.5),
            p99_ms: of.latency.quantile_ms(0.99),
            max_ms: of.latency.max_ms(),
        })
        .collect()
}

/// Seconds over which rates of the server's series are averaged. They must be several, because the
/// server counts processor time in whole seconds.
const OVER_S: f64 = 5.0;

fn server_series(plan: &Plan, of: &Ingredients) -> Vec<ServerRow> {
    let all = of.scrapes.as_ref().map(|s| s.all.as_slice()).unwrap_or_default();
    let before = |now: &Scrape| {
        let before = all.iter().rev().find(|s| s.at_s <= now.at_s - OVER_S + 0.05);
        before.or(all.first())
    };
    all.iter()
        .filter_map(|now| Some((before(now)?, now)))
        .map(|(before, now)| {
            let seconds = (now.at_s - before.at_s).max(1e-3);
            let own = |at: f64| of.harvest.own.look_at(at).copied().unwrap_or_default();
            let (own_before, own_now) = (own(before.at_s), own(now.at_s));
            ServerRow {
                t: now.at_s - plan.warmup_s,
                rss_bytes: rss(&now.metrics),
                cpus: now.metrics.grown(&before.metrics, CPU, &[]).unwrap_or(0.0) / seconds,
                pending_characters: now.metrics.sum("troupe_pending_characters", &[]).unwrap_or(0.0),
                batch_mean: now
                    .metrics
                    .mean(&before.metrics, "troupe_batch_size", &[])
                    .map_or(0.0, |m| m.0),
                sessions: now.metrics.sum("troupe_sessions_active", &[]).unwrap_or(0.0),
                client_rss_bytes: own_now.rss_bytes,
                client_cpus: (own_now.cpu_s - own_before.cpu_s).max(0.0) / seconds,
            }
        })
        .collect()
}

/// Number of batches by size, from the server's histogram. Without metrics, the number of answers
/// by the size of their batch.
fn batch_sizes(harvest: &Harvest, ends: Option<(&Scrape, &Scrape)>) -> Vec<(u32, u64)> {
    if let Some((first, last)) = ends {
        let buckets = last.metrics.buckets(&first.metrics, "troupe_batch_size");
        let buckets = buckets.into_iter().filter(|(_, count)| *count > 0.0);
        return buckets
            .map(|(bound, count)| (bound.min(f64::from(u32::MAX)) as u32, count as u64))
            .collect();
    }
    harvest
        .timing
        .batches
        .iter()
        .map(|(&size, &count)| (size, count))
        .collect()
}

#[cfg(test)]
mod tests {
    use crate::figures::testing::run;

    #[test]
    fn the_parts_of_the_mean_latency_add_up_to_it() {
        let figures = run(5.0).figures;
        let split = figures.split_ms.unwrap();
        let parts = [
            split.client,
            split.transport,
            split.server_other,
            split.queue,
            split.assemble,
            split.inference,
            split.scatter,
        ];
        assert!((parts.iter().sum::<f64>() - figures.latency_ms.mean).abs() < 0.01);
        assert!((split.transport - 3.0).abs() < 1e-6);
        assert!((split.server_other - 0.5).abs() < 1e-6);
    }

    #[test]
    fn figures_of_the_server_cover_the_measured_time() {
        let figures = run(5.0).figures;
        let server = figures.server.unwrap();
        assert_eq!((server.batches, server.batch_mean), (80.0, 4.0));
        assert!((server.cpus_busy - 0.2).abs() < 1e-9);
        assert_eq!(server.rss_peak_bytes, 100_000_100);
        assert!((figures.throughput.frames_per_s - 6400.0).abs() < 100.0);
    }
}
