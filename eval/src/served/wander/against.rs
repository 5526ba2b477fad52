//! The figures of gaps that the same pack filled.

use std::path::Path;

use serde::Deserialize;
use troupe_cli::Failure;
use troupe_client::Pack;
use troupe_motion::metrics::Estimate;

use super::measure::{KINDS, Kinds};

/// The fields of the JSON of `troupe-eval gaps` that count here.
#[derive(Deserialize)]
struct Evaluation {
    content_hash: String,
    gaps: Vec<Gap>,
}

#[derive(Deserialize)]
struct Gap {
    metrics: Methods,
}

#[derive(Deserialize)]
struct Methods {
    pack: std::collections::BTreeMap<String, Estimate>,
}

/// The figures of gaps that a pack filled, each the mean over the lengths of gap that were
/// measured.
///
/// The ends of the intervals are means too, since all lengths are measured on the same clips.
pub(super) fn read(path: &Path, pack: &Pack) -> Result<Kinds<Estimate>, Failure> {
    let text = std::fs::read_to_string(path).map_err(|e| Failure::file(path, e))?;
    let evaluation: Evaluation = serde_json::from_str(&text).map_err(|e| {
        Failure::file(
            path,
            format_args!("is not what `troupe-eval gaps --json` writes: {e}"),
        )
    })?;
    if evaluation.content_hash != pack.description().content_hash {
        return Err(Failure::file(
            path,
            format_args!("is of another pack than `{}` as it is served", pack.name()),
        ));
    }
    figures(&evaluation.gaps).map_err(|name| Failure::file(path, format_args!("has no {name}")))
}

fn figures(gaps: &[Gap]) -> Result<Kinds<Estimate>, &'static str> {
    let mut found = [Estimate::bare(0.0); KINDS.len()];
    for (found, kind) in found.iter_mut().zip(&KINDS) {
        let estimates: Option<Vec<Estimate>> = gaps
            .iter()
            .map(|gap| gap.metrics.pack.get(kind.key).copied())
            .collect();
        let estimates = estimates.filter(|all| !all.is_empty()).ok_or(kind.key)?;
        let count = estimates.len() as f64;
        let mean = |of: fn(&Estimate) -> Option<f64>| {
            let sum: Option<f64> = estimates.iter().map(of).sum();
            sum.map(|sum| sum / count)
        };
        *found = Estimate {
            mean: estimates.iter().map(|e| e.mean).sum::<f64>() / count,
            low: mean(|e| e.low),
            high: mean(|e| e.high),
        };
    }
    Ok(found)
}

/// `figure` as a multiple of `base`. The interval takes both as independent: their relative widths
/// add up as squares.
pub(super) fn ratio(figure: Estimate, base: Estimate) -> Option<Estimate> {
    if base.mean <= 0.0 || base.mean.is_nan() {
        return None;
    }
    let mean = figure.mean / base.mean;
    // How many times larger one is than the other, as a logarithm.
    let apart = |large: Option<f64>, small: Option<f64>| {
        let both = large
            .zip(small)
            .filter(|(large, small)| *large > 0.0 && *small > 0.0);
        both.map(|(large, small)| (large / small).ln())
    };
    let end = |of_figure: Option<f64>, of_base: Option<f64>, sign: f64| {
        let of_figure = of_figure?;
        Some(mean * (sign * of_figure.hypot(of_base.unwrap_or(0.0))).exp())
    };
    Some(Estimate {
        mean,
        low: end(
            apart(Some(figure.mean), figure.low),
            apart(base.high, Some(base.mean)),
            -1.0,
        ),
        high: end(
            apart(figure.high, Some(figure.mean)),
            apart(Some(base.mean), base.low),
            1.0,
        ),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn estimate(mean: f64, low: f64, high: f64) -> Estimate {
        Estimate {
            mean,
            low: Some(low),
            high: Some(high),
        }
    }

    #[test]
    fn ratios_have_the_uncertainty_of_both() {
        // The base is exact, so the interval is the figure's alone: twice and half.
        let sure = estimate(2.0, 2.0, 2.0);
        let found = ratio(estimate(3.0, 1.5, 6.0), sure).unwrap();
        let near = |a: Option<f64>, b: f64| assert!((a.unwrap() - b).abs() < 1e-9, "{a:?} is not {b}");
        assert_eq!(found.mean, 1.5);
        near(found.low, 0.75);
        near(found.high, 3.0);
        // Both are uncertain by a factor of e, so the ratio is by e^√2.
        let e = std::f64::consts::E;
        let wide = estimate(1.0, 1.0 / e, e);
        let found = ratio(wide, wide).unwrap();
        near(found.low, (-(2f64.sqrt())).exp());
        near(found.high, 2f64.sqrt().exp());
        assert_eq!(ratio(sure, estimate(0.0, 0.0, 0.0)), None);
        let alone = ratio(Estimate::bare(3.0), sure).unwrap();
        assert_eq!((alone.mean, alone.low), (1.5, None));
        // Without an interval of the base, the figure's counts.
        near(
            ratio(estimate(3.0, 1.5, 6.0), Estimate::bare(2.0)).unwrap().high,
            3.0,
        );
    }

    #[test]
    fn gaps_count_alike() {
        let gap = |mean: f64| -> Gap {
            let estimate = serde_json::json!({"mean": mean, "low": mean - 1.0, "high": mean + 3.0});
            let names = KINDS.map(|kind| (kind.key.to_owned(), estimate.clone()));
            let pack: serde_json::Map<String, serde_json::Value> = names.into_iter().collect();
            serde_json::from_value(serde_json::json!({"gap_frames": 15, "metrics": {"pack": pack}})).unwrap()
        };
        let found = figures(&[gap(2.0), gap(4.0)]).unwrap();
        assert!(found.iter().all(|f| *f == estimate(3.0, 2.0, 6.0)), "{found:?}");
        assert_eq!(figures(&[]), Err("foot_skate_m_per_frame"));
    }
}
