//! Runs of contact, and smooth series over frames.

use std::ops::Range;

/// Runs of frames for which `on` is true. Gaps of at most `gap` frames are closed. Runs of fewer
/// than `least` frames are dropped, unless they touch the first frame (`keep[0]`) or the last
/// (`keep[1]`).
pub(crate) fn spans(
    frames: usize,
    on: impl Fn(usize) -> bool,
    gap: usize,
    least: usize,
    keep: [bool; 2],
) -> Vec<Range<usize>> {
    let mut spans: Vec<Range<usize>> = Vec::new();
    for frame in (0..frames).filter(|&frame| on(frame)) {
        match spans.last_mut() {
            Some(last) if frame - last.end <= gap => last.end = frame + 1,
            _ => spans.push(frame..frame + 1),
        }
    }
    spans.retain(|span| {
        span.len() >= least || (keep[0] && span.start == 0) || (keep[1] && span.end == frames)
    });
    spans
}

/// The mean over `half` frames on either side; the first and last value repeat beyond the ends.
pub(crate) fn smooth(values: &[f32], half: usize) -> Vec<f32> {
    let at = |index: usize| values[index.saturating_sub(half).min(values.len() - 1)];
    let count = (2 * half + 1) as f32;
    (0..values.len())
        .map(|frame| (frame..=frame + 2 * half).map(at).sum::<f32>() / count)
        .collect()
}

/// A smooth series that is nowhere below `needs`: spread over `2 * half` frames on either side,
/// then smoothed twice.
pub(crate) fn cover(needs: &[f32], half: usize) -> Vec<f32> {
    if needs.iter().all(|&need| need <= 0.0) {
        return vec![0.0; needs.len()];
    }
    let reach = 2 * half;
    let spread: Vec<f32> = (0..needs.len())
        .map(|frame| {
            let near = &needs[frame.saturating_sub(reach)..(frame + reach + 1).min(needs.len())];
            near.iter().copied().fold(0.0, f32::max)
        })
        .collect();
    smooth(&smooth(&spread, half), half)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn gaps_close_and_short_runs_go() {
        let on = |text: &'static str| move |frame: usize| text.as_bytes()[frame] == b'x';
        let found = |text: &'static str, keep| spans(text.len(), on(text), 1, 3, keep);
        assert_eq!(found("..xx.x..xx....xxx", [false; 2]), [2..6, 14..17]);
        assert_eq!(found("x.......xx", [true, false]), vec![0..1; 1]);
        assert_eq!(found("x.......xx", [false, true]), vec![8..10; 1]);
        assert!(found("", [true, true]).is_empty());
    }

    proptest! {
        #[test]
        fn a_cover_is_above_and_smooth(needs in proptest::collection::vec(-1.0f32..1.0, 1..40), half in 0usize..6) {
            let cover = cover(&needs, half);
            prop_assert_eq!(cover.len(), needs.len());
            for (c, n) in cover.iter().zip(&needs) {
                prop_assert!(*c >= n - 1e-5 && *c >= 0.0 && *c <= 1.0 + 1e-5);
            }
            let step = 1.0 / (2 * half + 1) as f32;
            prop_assert!(cover.windows(2).all(|w| (w[1] - w[0]).abs() <= step + 1e-5));
        }
    }
}
