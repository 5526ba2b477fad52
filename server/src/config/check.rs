//! The ranges of options.

use super::{Config, ConfigError};
use troupe_live::records::RecordsError;

/// Largest memory for networks, MiB: more than any machine has.
const MOST_NETWORK_MIB: u64 = 1 << 30;
/// Most GPUs: more than any machine has.
const MOST_GPUS: u64 = 1 << 10;

/// The longest address of a server: that of a name in DNS, and a port.
const MOST_ADDRESS_BYTES: usize = 260;

/// The largest batch that an operator may ask for.
const MOST_BATCH: usize = 4096;

impl Config {
    /// The configuration, if all values are in their ranges.
    pub(super) fn checked(self) -> Result<Self, ConfigError> {
        let at_least_one = [
            ("max_sessions", self.max_sessions),
            ("max_scene_memory_mib", self.max_scene_memory_mib),
            ("max_streams", self.max_streams),
            ("request_timeout_ms", self.request_timeout_ms as usize),
        ];
        for (option, value) in at_least_one {
            if value == 0 {
                return Err(not_allowed(option, 0, "1 or more".into()));
            }
        }
        let at_most = [
            ("max_batch", self.max_batch, MOST_BATCH),
            ("threads", self.threads, 1024),
            ("workers", self.workers, 64),
            ("max_connections", self.max_connections, 1_000_000),
            ("max_sessions", self.max_sessions, 1_000_000),
        ];
        for (option, value, most) in at_most {
            if value > most {
                let least = at_least_one.iter().any(|&(name, _)| name == option);
                let allowed = format!("{} to {most}", u8::from(least));
                return Err(not_allowed(option, value as u64, allowed));
            }
        }
        let at_most = [
            ("max_queue_ms", self.max_queue_ms, 3_600_000),
            ("drain_delay_ms", self.drain_delay_ms, 3_600_000),
            ("watch_packs_s", self.watch_packs_s, 86_400),
            ("network_memory_mib", self.network_memory_mib, MOST_NETWORK_MIB),
            ("gpu_device", self.gpu_device.into(), MOST_GPUS - 1),
            ("gpu_memory_mib", self.gpu_memory_mib, MOST_NETWORK_MIB),
            ("memory_limit_mib", self.memory_limit_mib, MOST_NETWORK_MIB),
            ("transfer_memory_mib", self.transfer_memory_mib, MOST_NETWORK_MIB),
        ];
        for (option, value, most) in at_most {
            if value > most {
                return Err(not_allowed(option, value, format!("0 to {most}")));
            }
        }
        if !(0.0..=1.0).contains(&self.trace_sample_ratio) {
            return Err(ConfigError::Value {
                option: "trace_sample_ratio",
                found: self.trace_sample_ratio.to_string(),
                allowed: "0 to 1".to_owned(),
            });
        }
        let is_http = |url: &String| {
            let url = url.parse::<http::Uri>();
            url.is_ok_and(|url| url.scheme_str() == Some("http") && url.host().is_some())
        };
        if let Some(url) = self.otlp_endpoint.as_ref().filter(|url| !is_http(url)) {
            return Err(ConfigError::Value {
                option: "otlp_endpoint",
                found: url.clone(),
                allowed: "http://HOST:PORT".to_owned(),
            });
        }
        if self.health_listen == Some(self.listen) && self.listen.port() != 0 {
            return Err(ConfigError::Value {
                option: "health_listen",
                found: self.listen.to_string(),
                allowed: "an address other than listen".to_owned(),
            });
        }
        self.store_is_reachable()?;
        self.tls_is_whole()?;
        self.tokens_are_whole()?;
        Ok(self)
    }

    /// Checks the address of a shared store, and that other servers can name this one.
    fn store_is_reachable(&self) -> Result<(), ConfigError> {
        let Some(place) = self.shared_store() else {
            return Ok(());
        };
        if let Err(RecordsError::Address { found, allowed }) = place {
            return Err(ConfigError::Value {
                option: "store",
                found,
                allowed: allowed.to_owned(),
            });
        }
        let is_address = |address: &str| {
            let port = address.rsplit_once(':').filter(|(host, _)| !host.is_empty());
            port.is_some_and(|(_, port)| port.parse::<u16>().is_ok()) && address.len() <= MOST_ADDRESS_BYTES
        };
        let found = match &self.advertise {
            Some(address) if is_address(address) => return Ok(()),
            Some(address) => address.clone(),
            None if self.listen.ip().is_unspecified() => "missing".to_owned(),
            None => return Ok(()),
        };
        Err(ConfigError::Value {
            option: "advertise",
            found,
            allowed: "HOST:PORT under which clients reach this server".to_owned(),
        })
    }

    /// Checks that a certificate has its key, and that authorities of clients come with a
    /// certificate.
    fn tls_is_whole(&self) -> Result<(), ConfigError> {
        match (&self.tls_certificate, &self.tls_key, &self.tls_client_ca) {
            (Some(_), None, _) => missing("tls_key", "tls_certificate"),
            (None, Some(_), _) => missing("tls_certificate", "tls_key"),
            (None, None, Some(_)) => missing("tls_certificate", "tls_client_ca"),
            _ => Ok(()),
        }
    }

    fn tokens_are_whole(&self) -> Result<(), ConfigError> {
        match (&self.jwks, &self.jwt_issuer, &self.jwt_audience) {
            (None, Some(_), _) => missing("jwks", "jwt_issuer"),
            (None, None, Some(_)) => missing("jwks", "jwt_audience"),
            _ => Ok(()),
        }
    }
}

fn missing(option: &'static str, beside: &str) -> Result<(), ConfigError> {
    Err(ConfigError::Value {
        option,
        found: "missing".to_owned(),
        allowed: format!("a file, because {beside} is set"),
    })
}

fn not_allowed(option: &'static str, found: u64, allowed: String) -> ConfigError {
    ConfigError::Value {
        option,
        found: found.to_string(),
        allowed,
    }
}
