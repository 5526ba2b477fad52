//! How a language model chooses tokens, as `say` and `describe` are told it.

use clap::Args;
use troupe_client::TokenSampling;

const SAMPLING: &str = "Sampling";

/// Seed and sampling of tokens.
#[derive(Debug, Args)]
pub(crate) struct Tokens {
    /// The same seed, input and pack give the same answer.
    #[arg(long, help_heading = SAMPLING, default_value_t = 0)]
    pub(crate) seed: u64,

    /// 0 takes the most likely tokens; above, they are drawn with the seed. Without it as the pack
    /// says.
    #[arg(long, help_heading = SAMPLING, value_name = "0-2")]
    pub(crate) temperature: Option<f32>,

    /// How many of the likeliest tokens may be drawn; 0 for all of them. Without it as the pack
    /// says.
    #[arg(long, help_heading = SAMPLING, value_name = "COUNT")]
    pub(crate) top_k: Option<u32>,

    /// The likeliest tokens that may be drawn are together at least so likely. Without it as the
    /// pack says.
    #[arg(long, help_heading = SAMPLING, value_name = "0-1")]
    pub(crate) top_p: Option<f32>,

    /// What the last tokens are weakened by; 1 for nothing. Without it as the pack says.
    #[arg(long, help_heading = SAMPLING, value_name = "1-10")]
    pub(crate) repetition: Option<f32>,
}

impl Tokens {
    /// What is said of sampling.
    pub(crate) fn sampling(&self) -> TokenSampling {
        let sampling = TokenSampling::new();
        let set = |sampling: TokenSampling, value, with: fn(TokenSampling, f32) -> TokenSampling| match value
        {
            Some(value) => with(sampling, value),
            None => sampling,
        };
        let sampling = set(sampling, self.temperature, TokenSampling::temperature);
        let sampling = set(sampling, self.top_p, TokenSampling::top_p);
        let sampling = set(sampling, self.repetition, TokenSampling::repetition);
        match self.top_k {
            Some(count) => sampling.top_k(count),
            None => sampling,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_said_is_the_packs() {
        let tokens = Tokens {
            seed: 3,
            temperature: None,
            top_k: Some(7),
            top_p: None,
            repetition: Some(1.2),
        };
        assert_eq!(tokens.sampling(), TokenSampling::new().repetition(1.2).top_k(7));
    }
}
