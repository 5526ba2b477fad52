//! Values of arguments that clap does not know.

use std::str::FromStr;
use std::time::Duration;

/// A time span above zero, given in seconds.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Seconds(Duration);

impl From<Seconds> for Duration {
    fn from(seconds: Seconds) -> Self {
        seconds.0
    }
}

impl FromStr for Seconds {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let seconds = text.parse::<f64>().map_err(|e| e.to_string())?;
        let span = Duration::try_from_secs_f64(seconds).map_err(|e| e.to_string())?;
        if span.is_zero() {
            Err("must be above 0".to_owned())
        } else {
            Ok(Self(span))
        }
    }
}

/// A number of things, at least one.
pub fn positive(text: &str) -> Result<usize, String> {
    match text.parse::<usize>() {
        Ok(0) => Err("must be 1 or more".to_owned()),
        Ok(number) => Ok(number),
        Err(e) => Err(e.to_string()),
    }
}
