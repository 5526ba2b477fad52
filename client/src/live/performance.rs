//! A sentence to act out.

use troupe_proto::v1;

use super::act::Act;

/// A sentence that a character acts out. The character moves as before until the first frames have
/// come, and again afterwards. Events report when the performance begins and why it ends.
///
/// ```
/// use troupe_client::{Act, Performance};
///
/// let wave = Act::from(Performance::of("a person waves with both hands").seconds(3.0));
/// # assert_ne!(wave, Act::Cancel);
/// ```
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Performance {
    /// The sentence: 1 to 1000 characters.
    pub text: String,
    /// Name of the pack that acts it out. None: the server decides.
    pub pack: Option<String>,
    /// Length, 0.5 to 30 s. None: the model decides.
    pub seconds: Option<f32>,
    /// Temperature, 0 to 2. 0 takes the likeliest motion. None: the pack's.
    pub temperature: Option<f32>,
}

impl Performance {
    /// A performance of this sentence.
    pub fn of(text: impl Into<String>) -> Self {
        Self {
            text: text.into(),
            ..Self::default()
        }
    }

    /// Sets the pack.
    #[must_use]
    pub fn pack(self, name: impl Into<String>) -> Self {
        Self {
            pack: Some(name.into()),
            ..self
        }
    }

    /// Sets the length, 0.5 to 30 s.
    #[must_use]
    pub fn seconds(self, seconds: f32) -> Self {
        Self {
            seconds: Some(seconds),
            ..self
        }
    }

    /// Sets the temperature, 0 to 2.
    #[must_use]
    pub fn temperature(self, temperature: f32) -> Self {
        Self {
            temperature: Some(temperature),
            ..self
        }
    }

    pub(super) fn to_message(&self) -> v1::Perform {
        v1::Perform {
            text: self.text.clone(),
            pack: self.pack.clone().unwrap_or_default(),
            seconds: self.seconds,
            temperature: self.temperature,
        }
    }
}

impl From<Performance> for Act {
    fn from(performance: Performance) -> Self {
        Self::Perform(performance)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_that_are_not_set_are_left_to_the_server() {
        let bare = Act::from(Performance::of("wave")).to_message();
        assert_eq!(
            bare,
            v1::command::Intent::Perform(v1::Perform {
                text: "wave".to_owned(),
                ..v1::Perform::default()
            })
        );
        let whole = Performance::of("wave")
            .pack("words")
            .seconds(2.0)
            .temperature(0.5);
        let message = whole.to_message();
        assert_eq!(
            (message.pack.as_str(), message.seconds, message.temperature),
            ("words", Some(2.0), Some(0.5))
        );
    }
}
