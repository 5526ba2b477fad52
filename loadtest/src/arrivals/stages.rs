//! How a rate, or a number of clients, changes over time.

use std::fmt;
use std::str::FromStr;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A time during which a level is constant or changes linearly.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct LoadStage {
    /// Level at the start: requests a second, or clients.
    pub from: f64,
    /// Level at the end.
    pub to: f64,
    /// Length, seconds.
    pub seconds: f64,
}

/// Stages one after another. After the last the level is 0.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(transparent)]
pub struct Stages(Vec<LoadStage>);

/// Why stages cannot be used.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum StagesError {
    /// The text is not of the form LEVEL:SECONDS or FROM-TO:SECONDS.
    #[error("{0:?} is not a stage; allowed: LEVEL:SECONDS or FROM-TO:SECONDS, such as 50:10 or 50-200:30")]
    Form(String),
    /// A number is out of its range.
    #[error("{0:?}: levels are 0 to 1000000 and seconds above 0, to 86400")]
    Range(String),
    /// There is no stage, or all levels are 0.
    #[error("all levels are 0; allowed: at least one stage with a level above 0")]
    Nothing,
}

impl Stages {
    /// Makes one stage with a constant level.
    ///
    /// # Errors
    /// [`StagesError`] if a number is out of its range.
    pub fn hold(level: f64, seconds: f64) -> Result<Self, StagesError> {
        Self::new(vec![LoadStage {
            from: level,
            to: level,
            seconds,
        }])
    }

    /// Makes stages that follow each other.
    ///
    /// # Errors
    /// [`StagesError`] if a number is out of its range, or all levels are 0.
    pub fn new(stages: Vec<LoadStage>) -> Result<Self, StagesError> {
        for stage in &stages {
            let level = |level: f64| (0.0..=1e6).contains(&level);
            let seconds = stage.seconds > 0.0 && stage.seconds <= 86_400.0;
            if !(level(stage.from) && level(stage.to) && seconds) {
                return Err(StagesError::Range(stage.to_string()));
            }
        }
        if stages.iter().all(|s| s.from <= 0.0 && s.to <= 0.0) {
            return Err(StagesError::Nothing);
        }
        Ok(Self(stages))
    }

    /// The stages in order.
    pub fn iter(&self) -> impl Iterator<Item = &LoadStage> {
        self.0.iter()
    }

    /// Number of stages; never 0.
    pub fn count(&self) -> usize {
        self.0.len()
    }

    /// Sum of their lengths, seconds.
    pub fn seconds(&self) -> f64 {
        self.0.iter().map(|s| s.seconds).sum()
    }

    /// The highest level.
    pub fn most(&self) -> f64 {
        self.0.iter().map(|s| s.from.max(s.to)).fold(0.0, f64::max)
    }

    /// Level at a time, seconds from the start.
    pub fn level(&self, at: f64) -> f64 {
        match self.place(at) {
            Some((index, into)) => {
                let stage = &self.0[index];
                stage.from + (stage.to - stage.from) * (into / stage.seconds)
            }
            None => 0.0,
        }
    }

    /// The stage at a time, seconds from the start. None before the first and after the last.
    pub fn stage_at(&self, at: f64) -> Option<usize> {
        self.place(at).map(|(index, _)| index)
    }

    fn place(&self, at: f64) -> Option<(usize, f64)> {
        let mut begin = 0.0;
        for (index, stage) in self.0.iter().enumerate() {
            if at < begin {
                return None;
            }
            if at < begin + stage.seconds {
                return Some((index, at - begin));
            }
            begin += stage.seconds;
        }
        None
    }

    /// The integral of the level from 0 to `at` seconds. For a rate, this is the number of requests
    /// due by then.
    pub fn sum_until(&self, at: f64) -> f64 {
        let mut begin = 0.0;
        let mut sum = 0.0;
        for stage in &self.0 {
            let into = (at - begin).clamp(0.0, stage.seconds);
            sum += into * (stage.from + (stage.to - stage.from) * into / stage.seconds / 2.0);
            begin += stage.seconds;
        }
        sum
    }

    /// The time at which [`Self::sum_until`] reaches `sum`. None if it never does.
    pub fn time_of_sum(&self, sum: f64) -> Option<f64> {
        let mut begin = 0.0;
        let mut left = sum.max(0.0);
        for stage in &self.0 {
            let whole = (stage.from + stage.to) / 2.0 * stage.seconds;
            if left < whole {
                return Some(begin + into_stage(stage, left));
            }
            left -= whole;
            begin += stage.seconds;
        }
        None
    }

    /// Adds a stage before the first, with its level, for instance to warm up.
    #[must_use]
    pub fn after_hold(mut self, seconds: f64) -> Self {
        if seconds > 0.0 {
            let level = self.0.first().map_or(0.0, |s| s.from.max(s.to.min(1.0)));
            let hold = LoadStage {
                from: level,
                to: level,
                seconds,
            };
            self.0.insert(0, hold);
        }
        self
    }
}

/// The time within a stage at which its integral is `sum`. `sum` must be below the integral of the
/// whole stage. The formula is a root of a parabola, in the form that stays exact for small slopes.
fn into_stage(stage: &LoadStage, sum: f64) -> f64 {
    let slope = (stage.to - stage.from) / stage.seconds;
    let root = (stage.from * stage.from + 2.0 * slope * sum).max(0.0).sqrt();
    let below = stage.from + root;
    if below > 0.0 {
        (2.0 * sum / below).clamp(0.0, stage.seconds)
    } else {
        0.0
    }
}

impl fmt::Display for LoadStage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.from == self.to {
            write!(f, "{}:{}", self.from, self.seconds)
        } else {
            write!(f, "{}-{}:{}", self.from, self.to, self.seconds)
        }
    }
}

impl fmt::Display for Stages {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (nth, stage) in self.0.iter().enumerate() {
            write!(f, "{}{stage}", if nth > 0 { "," } else { "" })?;
        }
        Ok(())
    }
}

impl FromStr for Stages {
    type Err = StagesError;

    fn from_str(text: &str) -> Result<Self, StagesError> {
        let stage = |text: &str| {
            let fault = || StagesError::Form(text.to_owned());
            let number = |text: &str| text.trim().parse::<f64>().map_err(|_| fault());
            let (level, seconds) = text.split_once(':').ok_or_else(fault)?;
            let (from, to) = match level.split_once('-') {
                Some((from, to)) => (number(from)?, number(to)?),
                None => (number(level)?, number(level)?),
            };
            Ok(LoadStage {
                from,
                to,
                seconds: number(seconds)?,
            })
        };
        Self::new(text.split(',').map(stage).collect::<Result<_, _>>()?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn stages_are_read_and_written() {
        let stages: Stages = "50:10,50-200:30,0:5".parse().unwrap();
        assert_eq!(stages.to_string(), "50:10,50-200:30,0:5");
        assert_eq!(
            (stages.count(), stages.seconds(), stages.most()),
            (3, 45.0, 200.0)
        );
        assert_eq!(
            [0.0, 9.9, 25.0, 42.0, 45.0].map(|t| stages.level(t)),
            [50.0, 50.0, 125.0, 0.0, 0.0]
        );
        assert_eq!(stages.stage_at(25.0), Some(1));
        assert_eq!(stages.stage_at(-1.0), None);
        for (text, wanted) in [
            ("", "LEVEL:SECONDS"),
            ("50", "LEVEL:SECONDS"),
            ("x:1", "LEVEL:SECONDS"),
            ("1:0", "seconds above 0"),
            ("-1:2", "LEVEL:SECONDS"),
            ("2000000:2", "0 to 1000000"),
            ("0:4", "above 0"),
            ("1:NaN", "seconds above 0"),
        ] {
            let error = text.parse::<Stages>().unwrap_err().to_string();
            assert!(error.contains(wanted), "{text}: {error}");
        }
    }

    proptest! {
        #[test]
        fn time_of_sum_is_the_inverse_of_sum_until(
            parts in prop::collection::vec((0.0..500.0_f64, 0.0..500.0_f64, 0.1..20.0_f64), 1..5),
            share in 0.0..1.0_f64,
        ) {
            let stages = parts.into_iter().map(|(from, to, seconds)| LoadStage { from, to, seconds });
            let stages = Stages::new(stages.collect()).unwrap();
            let all = stages.sum_until(stages.seconds());
            let sum = all * share * 0.999;
            let at = stages.time_of_sum(sum).unwrap();
            prop_assert!((stages.sum_until(at) - sum).abs() < 1e-6 * all.max(1.0), "{at}");
            prop_assert_eq!(stages.time_of_sum(all + 1.0), None);
        }
    }
}
