//! From a clip's file to a closed cycle.

use std::path::Path;

use troupe_client::Pack;
use troupe_motion::clip::Clip;
use troupe_motion::gait::{ClosedCycle, CycleOptions, StandOptions, Way, find_cycles, find_stand};

use crate::failure::Failure;
use crate::files::read_clip;
use crate::reading::Reading;
use crate::term::Term;

/// Names of gaits that stand begin with this.
const STANDS: &str = "idle";

/// Whether a gait stands, by its name.
pub(super) fn stands(gait: &str) -> bool {
    gait.starts_with(STANDS)
}

/// A gait in a clip.
pub(super) struct Extracted {
    pub(super) cycle: ClosedCycle,
    /// The frame of the clip at which it begins.
    pub(super) start: usize,
    /// Distance between the ends of the cycle before it was closed, metres; 0 of a stand.
    pub(super) closure_m: f32,
}

/// Where in a file to look for which gait.
pub(super) struct GaitSource<'a> {
    pub(super) path: &'a Path,
    pub(super) gait: &'a str,
    pub(super) from: Option<usize>,
    pub(super) to: Option<usize>,
}

impl GaitSource<'_> {
    /// Reads the clip and finds the gait: for a name that has `turn` in it the cycle that turns
    /// most, for one that stands the stillest frame, or the only one that is to be looked at; else
    /// the steadiest cycle.
    pub(super) fn extract(&self, pack: &Pack, reading: &Reading, term: &Term) -> Result<Extracted, Failure> {
        let whole = read_clip(self.path, pack, reading, term)?;
        let (clip, first) = self.cut(&whole)?;
        let failed = |e| Failure::file(self.path, format_args!("no gait `{}`: {e}", self.gait));
        if stands(self.gait) && clip.frames() == 1 {
            return Ok(Extracted {
                cycle: ClosedCycle::stand(&clip, 0),
                start: first,
                closure_m: 0.0,
            });
        }
        if stands(self.gait) {
            let stand = find_stand(&clip, &StandOptions::default()).map_err(failed)?;
            return Ok(Extracted {
                cycle: ClosedCycle::stand(&clip, stand.frame),
                start: first + stand.frame,
                closure_m: 0.0,
            });
        }
        let way = if self.gait.contains("turn") {
            Way::Turning
        } else {
            Way::Straight
        };
        let options = CycleOptions {
            way,
            ..CycleOptions::default()
        };
        let found = find_cycles(&clip, &options).map_err(failed)?;
        let best = &found[0];
        Ok(Extracted {
            cycle: ClosedCycle::new(&clip, best),
            start: first + best.start,
            closure_m: best.closure_m,
        })
    }

    /// The frames to look at, and the first of them.
    fn cut(&self, clip: &Clip) -> Result<(Clip, usize), Failure> {
        let first = self.from.unwrap_or(0);
        let last = self.to.unwrap_or(clip.frames() - 1);
        if last < first || last >= clip.frames() {
            return Err(Failure::file(
                self.path,
                format_args!(
                    "frames {first} to {last} are not in it; it has 0 to {}",
                    clip.frames() - 1
                ),
            ));
        }
        let part = clip
            .slice(first..last + 1)
            .map_err(|e| Failure::file(self.path, e))?;
        Ok((part, first))
    }
}
