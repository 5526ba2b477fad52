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

/// A place over the ground and a heading, given as x and z in metres and degrees: `1.5,3,90`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Place {
    /// x and z, metres.
    pub(crate) ground: [f32; 2],
    /// Radians: 0 faces +Z.
    pub(crate) heading: f32,
}

impl FromStr for Place {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let number = |text: &str| text.trim().parse().ok().filter(|number: &f32| number.is_finite());
        let numbers: Option<Vec<f32>> = text.split(',').map(number).collect();
        match numbers.as_deref() {
            Some(&[x, z, degrees]) => Ok(Self {
                ground: [x, z],
                heading: degrees.to_radians(),
            }),
            _ => Err("must be x and z in metres and a heading in degrees, such as 1.5,3,90".to_owned()),
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

#[cfg(test)]
mod tests {
    use std::f32::consts::FRAC_PI_2;

    use super::*;

    #[test]
    fn a_place_has_metres_and_degrees() {
        let place = Place {
            ground: [1.5, -3.0],
            heading: FRAC_PI_2,
        };
        assert_eq!("1.5, -3,90".parse(), Ok(place));
        for wrong in ["", "1,2", "1,2,3,4", "1,2,east", "1,NaN,0"] {
            let error = wrong.parse::<Place>().unwrap_err();
            assert!(error.contains("degrees"), "{wrong}: {error}");
        }
    }
}
