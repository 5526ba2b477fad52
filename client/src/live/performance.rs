//! A sentence to act out.

use troupe_proto::v1;

use super::act::Act;

/// A sentence that a character acts out: it goes on as it does until the first frames have come,
/// and takes up again what it did. Events say when it begins and why it ends.
///
/// ```
/// use troupe_client::{Act, Performance};
///
/// let wave = Act::from(Performance::of("a person waves with both hands").seconds(3.0));
/// # assert_ne!(wave, Act::Cancel);
/// ```
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Performance {
    /// What to do: 1 to 1000 characters.
    pub text: String,
    /// Name of the pack that makes motion of it. None: the server's.
    pub pack: Option<String>,
    /// How long, 0.5 to 30 s. None: as long as the model finds right.
    pub seconds: Option<f32>,
    /// 0 takes the likeliest motion, more varies: 0 to 2. None: the pack's.
    pub temperature: Option<f32>,
}

impl Performance {
    /// Of this sentence.
    pub fn of(text: impl Into<String>) -> Self {
        Self {
            text: text.into(),
            ..Self::default()
        }
    }

    /// By this pack.
    #[must_use]
    pub fn pack(self, name: impl Into<String>) -> Self {
        Self {
            pack: Some(name.into()),
            ..self
        }
    }

    /// Lasts so long, 0.5 to 30 s.
    #[must_use]
    pub fn seconds(self, seconds: f32) -> Self {
        Self {
            seconds: Some(seconds),
            ..self
        }
    }

    /// Varies so much, 0 to 2.
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
    fn what_is_left_out_is_left_to_the_server() {
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
