//! Limits the number of connections, in all and of each address, with a reserve for health checks.

use std::collections::HashMap;
use std::net::{IpAddr, Ipv6Addr};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use troupe_base::telemetry::{Counter, Gauge, Labels, Metric, Telemetry};

/// Connections beyond the limit on which health checks and metrics are still answered.
pub(super) const RESERVE: usize = 16;
/// The first 64 bits of an IPv6 address. A provider assigns them to a customer, who chooses the
/// other bits.
const IPV6_NETWORK: u128 = !0 << 64;

const ACTIVE: Metric = Metric::new("troupe_connections_active", "Open connections");
const REFUSED: Metric = Metric::new(
    "troupe_connections_refused_total",
    "Connections without a regular slot, by reason: closed at max_connections (limit) or at the limit of \
     their address (address), answered from the reserve (reserve), or not accepted by the system (accept)",
);

const HANDSHAKES_FAILED: Metric = Metric::new(
    "troupe_tls_handshakes_failed_total",
    "TLS handshakes that failed: too slow, not TLS, or without an accepted client certificate",
);

/// Why a connection gets no slot and is closed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub(super) enum ConnectionRefusal {
    /// All slots and the reserve are taken.
    #[error("max_connections are open")]
    Full,
    /// All slots of this address are taken.
    #[error("half of max_connections are open from one address")]
    Address,
}

/// The metrics of connections.
#[derive(Debug)]
struct ConnectionMetrics {
    active: Gauge,
    limit: Counter,
    address: Counter,
    reserve: Counter,
    accept: Counter,
    handshakes_failed: Counter,
}

impl ConnectionMetrics {
    fn new(telemetry: &Telemetry) -> Self {
        let refused = |reason| telemetry.counter(&REFUSED, &Labels::default().with("reason", reason));
        Self {
            active: telemetry.gauge(&ACTIVE, &Labels::default()),
            limit: refused("limit"),
            address: refused("address"),
            reserve: refused("reserve"),
            accept: refused("accept"),
            handshakes_failed: telemetry.counter(&HANDSHAKES_FAILED, &Labels::default()),
        }
    }
}

#[derive(Debug, Default)]
struct Taken {
    slots: usize,
    reserve: usize,
    addresses: HashMap<IpAddr, usize>,
}

/// The slots for a server's connections.
#[derive(Debug)]
pub struct ConnectionSlots {
    limit: usize,
    per_address: usize,
    taken: Mutex<Taken>,
    metrics: ConnectionMetrics,
}

impl ConnectionSlots {
    /// `limit` slots, of which one address may have `per_address`.
    pub fn new(limit: usize, per_address: usize, telemetry: &Telemetry) -> Arc<Self> {
        Arc::new(Self {
            limit,
            per_address,
            taken: Mutex::default(),
            metrics: ConnectionMetrics::new(telemetry),
        })
    }

    fn taken(&self) -> MutexGuard<'_, Taken> {
        self.taken.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes a slot for a connection from `address`.
    pub(super) fn take(self: &Arc<Self>, address: IpAddr) -> Result<ConnectionSlot, ConnectionRefusal> {
        let address = network(address);
        let mut taken = self.taken();
        let of_address = taken.addresses.get(&address).copied().unwrap_or_default();
        if of_address >= self.per_address {
            self.metrics.address.increment(1);
            return Err(ConnectionRefusal::Address);
        }
        let reserved = taken.slots >= self.limit;
        if !reserved {
            taken.slots += 1;
        } else if taken.reserve < RESERVE {
            taken.reserve += 1;
            self.metrics.reserve.increment(1);
        } else {
            self.metrics.limit.increment(1);
            return Err(ConnectionRefusal::Full);
        }
        taken.addresses.insert(address, of_address + 1);
        self.metrics.active.increment(1);
        Ok(ConnectionSlot {
            slots: self.clone(),
            address,
            reserved,
        })
    }

    /// Counts a connection whose TLS handshake failed.
    pub(super) fn handshake_failed(&self) {
        self.metrics.handshakes_failed.increment(1);
    }

    /// Counts a connection that the system did not accept.
    pub(super) fn not_accepted(&self) {
        self.metrics.accept.increment(1);
    }
}

/// The address that a connection counts for: for IPv6 its /64 network.
fn network(address: IpAddr) -> IpAddr {
    match address.to_canonical() {
        IpAddr::V6(address) => Ipv6Addr::from_bits(address.to_bits() & IPV6_NETWORK).into(),
        address => address,
    }
}

/// A connection's slot. Dropping it frees the slot.
#[derive(Debug)]
pub(super) struct ConnectionSlot {
    slots: Arc<ConnectionSlots>,
    address: IpAddr,
    reserved: bool,
}

impl ConnectionSlot {
    /// The address that the connection counts for; for IPv6 its /64 network.
    pub(super) fn address(&self) -> IpAddr {
        self.address
    }

    /// Whether it is a slot of the reserve.
    pub(super) fn is_reserved(&self) -> bool {
        self.reserved
    }
}

impl Drop for ConnectionSlot {
    fn drop(&mut self) {
        let mut taken = self.slots.taken();
        match self.reserved {
            true => taken.reserve -= 1,
            false => taken.slots -= 1,
        }
        if let Some(count) = taken.addresses.get_mut(&self.address) {
            *count -= 1;
            if *count == 0 {
                taken.addresses.remove(&self.address);
            }
        }
        self.slots.metrics.active.decrement(1);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn slots(limit: usize, per_address: usize) -> (Arc<ConnectionSlots>, Telemetry) {
        let telemetry = Telemetry::new().unwrap();
        (ConnectionSlots::new(limit, per_address, &telemetry), telemetry)
    }

    #[test]
    fn beyond_the_limit_there_is_a_reserve() {
        let (slots, telemetry) = slots(2, 100);
        let from = IpAddr::from([127, 0, 0, 1]);
        let first = slots.take(from).unwrap();
        let rest: Vec<_> = (0..1 + RESERVE).map(|_| slots.take(from).unwrap()).collect();
        assert_eq!(rest.iter().filter(|slot| slot.is_reserved()).count(), RESERVE);
        assert_eq!(slots.take(from).unwrap_err(), ConnectionRefusal::Full);
        drop(first);
        assert!(!slots.take(from).unwrap().is_reserved());
        drop(rest);
        let text = telemetry.render();
        for line in [
            "troupe_connections_active 0",
            r#"troupe_connections_refused_total{reason="limit"} 1"#,
            r#"troupe_connections_refused_total{reason="reserve"} 16"#,
        ] {
            assert!(text.contains(line), "{line} is missing in\n{text}");
        }
        let taken = slots.taken();
        assert_eq!((taken.slots, taken.reserve, taken.addresses.len()), (0, 0, 0));
    }

    #[test]
    fn an_address_has_a_limit_of_its_own() {
        let (slots, _) = slots(100, 1);
        let take = |text: &str| slots.take(text.parse().unwrap());
        let first = take("192.0.2.1").unwrap();
        assert_eq!(take("::ffff:192.0.2.1").unwrap_err(), ConnectionRefusal::Address);
        let _other = take("192.0.2.2").unwrap();
        drop(first);
        let _again = take("192.0.2.1").unwrap();
        let _network = take("2001:db8::1").unwrap();
        assert_eq!(take("2001:db8::2").unwrap_err(), ConnectionRefusal::Address);
        let _next = take("2001:db8:0:1::2").unwrap();
    }
}
