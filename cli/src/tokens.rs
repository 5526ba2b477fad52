//! Options of `say` for how a language model chooses tokens.

use clap::Args;
use troupe_client::TokenSampling;

const SAMPLING: &str = "Sampling";

/// Seed and sampling of tokens.
#[derive(Debug, Args)]
pub(crate) struct Tokens {
    /// The same seed, input and pack give the same answer.
    #[arg(long, help_heading = SAMPLING, default_value_t = 0)]
    pub(crate) seed: u64,

    /// 0 takes the most likely tokens. Above 0 they are drawn with the seed. Default: the pack's.
    #[arg(long, help_heading = SAMPLING, value_name = "0-2")]
    pub(crate) temperature: Option<f32>,

    /// Tokens are drawn from the likeliest ones whose probabilities add up to this. Default: the
    /// pack's.
    #[arg(long, help_heading = SAMPLING, value_name = "0-1")]
    pub(crate) top_p: Option<f32>,
}

impl Tokens {
    /// Sampling for a request. What the options leave out is up to the pack.
    pub(crate) fn sampling(&self) -> TokenSampling {
        let mut sampling = TokenSampling::new();
        if let Some(temperature) = self.temperature {
            sampling = sampling.temperature(temperature);
        }
        if let Some(share) = self.top_p {
            sampling = sampling.top_p(share);
        }
        sampling
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_that_are_left_out_are_the_packs() {
        let tokens = Tokens {
            seed: 3,
            temperature: None,
            top_p: Some(0.9),
        };
        assert_eq!(tokens.sampling(), TokenSampling::new().top_p(0.9));
    }
}
