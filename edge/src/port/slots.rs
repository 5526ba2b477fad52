//! Limits the number of connections, in all and of each address, with a reserve for health checks.
//!
//! If no slot is free, an idle connection makes room: the one that is open for longest, of the
//! address that has most connections.

use std::collections::{BTreeMap, HashMap};
use std::net::{IpAddr, Ipv6Addr};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use super::activity::Activity;
use troupe_base::telemetry::{Counter, Gauge, Labels, Metric, Telemetry};

/// Connections beyond the limit on which health checks and metrics are still answered.
pub(super) const RESERVE: usize = 16;
/// How long a connection of the reserve keeps its slot without a call if others want it.
const RESERVE_SPARE_IDLE: Duration = Duration::from_millis(300);
/// The first 64 bits of an IPv6 address. A provider assigns them to a customer, who chooses the
/// other bits.
const IPV6_NETWORK: u128 = !0 << 64;

const ACTIVE: Metric = Metric::new("troupe_connections_active", "Open connections");
const REFUSED: Metric = Metric::new(
    "troupe_connections_refused_total",
    "Connections without a regular slot, by reason: closed at max_connections (limit) or at the limit of \
     their address (address), answered from the reserve (reserve), or not accepted by the system (accept)",
);

const MADE_ROOM: Metric = Metric::new(
    "troupe_connections_made_room_total",
    "Idle connections that were closed because no slot was free for a new one",
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
    made_room: Counter,
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
            made_room: telemetry.counter(&MADE_ROOM, &Labels::default()),
            handshakes_failed: telemetry.counter(&HANDSHAKES_FAILED, &Labels::default()),
        }
    }
}

#[derive(Debug, Default)]
struct Taken {
    slots: usize,
    reserve: usize,
    /// The connections of each address by their numbers, so the oldest is first.
    addresses: HashMap<IpAddr, BTreeMap<u64, Open>>,
    /// Number of the next connection.
    next: u64,
}

/// A connection that has a slot.
#[derive(Debug)]
struct Open {
    activity: Arc<Activity>,
    reserved: bool,
}

impl Taken {
    /// Takes away the slot of a connection, if it still has one.
    fn remove(&mut self, address: IpAddr, number: u64) -> Option<Open> {
        let of_address = self.addresses.get_mut(&address)?;
        let open = of_address.remove(&number)?;
        if of_address.is_empty() {
            self.addresses.remove(&address);
        }
        match open.reserved {
            true => self.reserve -= 1,
            false => self.slots -= 1,
        }
        Some(open)
    }

    /// The connection that makes room: the oldest without a call for `idle`, of the address that
    /// has most connections and such a one among them.
    fn spare(&self, reserved: bool, idle: Duration) -> Option<(IpAddr, u64)> {
        let (mut most, mut spare) = (0, None);
        for (address, connections) in &self.addresses {
            if connections.len() <= most {
                continue;
            }
            let fits = |open: &Open| open.reserved == reserved && open.activity.is_idle(idle);
            if let Some((number, _)) = connections.iter().find(|(_, open)| fits(open)) {
                most = connections.len();
                spare = Some((*address, *number));
            }
        }
        spare
    }
}

/// The slots for a server's connections.
#[derive(Debug)]
pub struct ConnectionSlots {
    limit: usize,
    per_address: usize,
    /// How long a connection keeps its slot without a call if others want it.
    spare_idle: Duration,
    taken: Mutex<Taken>,
    metrics: ConnectionMetrics,
}

impl ConnectionSlots {
    /// `limit` slots, of which one address may have `per_address`. If all are taken, a connection
    /// without a call for `spare_idle` makes room.
    pub fn new(limit: usize, per_address: usize, spare_idle: Duration, telemetry: &Telemetry) -> Arc<Self> {
        Arc::new(Self {
            limit,
            per_address,
            spare_idle,
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
        let of_address = taken.addresses.get(&address).map_or(0, BTreeMap::len);
        if of_address >= self.per_address {
            self.metrics.address.increment(1);
            return Err(ConnectionRefusal::Address);
        }
        let reserved = taken.slots >= self.limit && !self.make_room(&mut taken, false, self.spare_idle);
        if !reserved {
            taken.slots += 1;
        } else if taken.reserve < RESERVE || self.make_room(&mut taken, true, RESERVE_SPARE_IDLE) {
            taken.reserve += 1;
            self.metrics.reserve.increment(1);
        } else {
            self.metrics.limit.increment(1);
            return Err(ConnectionRefusal::Full);
        }
        let activity = Activity::new();
        let number = taken.next;
        taken.next += 1;
        let open = Open {
            activity: activity.clone(),
            reserved,
        };
        taken.addresses.entry(address).or_default().insert(number, open);
        self.metrics.active.increment(1);
        Ok(ConnectionSlot {
            slots: self.clone(),
            activity,
            number,
            address,
            reserved,
        })
    }

    /// Ends an idle connection. Answers whether its slot is free now.
    fn make_room(&self, taken: &mut Taken, reserved: bool, idle: Duration) -> bool {
        let spare = taken.spare(reserved, idle);
        let Some(open) = spare.and_then(|(address, number)| taken.remove(address, number)) else {
            return false;
        };
        open.activity.cut();
        self.metrics.made_room.increment(1);
        true
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
    activity: Arc<Activity>,
    number: u64,
    address: IpAddr,
    reserved: bool,
}

impl ConnectionSlot {
    /// The address that the connection counts for; for IPv6 its /64 network.
    pub(super) fn address(&self) -> IpAddr {
        self.address
    }

    /// The activity on the connection.
    pub(super) fn activity(&self) -> &Arc<Activity> {
        &self.activity
    }

    /// Whether it is a slot of the reserve.
    pub(super) fn is_reserved(&self) -> bool {
        self.reserved
    }
}

impl Drop for ConnectionSlot {
    fn drop(&mut self) {
        // A connection that made room has no slot any more.
        let _ = self.slots.taken().remove(self.address, self.number);
        self.slots.metrics.active.decrement(1);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SPARE_IDLE: Duration = Duration::from_secs(2);

    fn slots(limit: usize, per_address: usize) -> (Arc<ConnectionSlots>, Telemetry) {
        let telemetry = Telemetry::new().unwrap();
        let slots = ConnectionSlots::new(limit, per_address, SPARE_IDLE, &telemetry);
        (slots, telemetry)
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

    #[tokio::test(start_paused = true)]
    async fn an_idle_connection_of_the_address_with_most_makes_room() {
        let (slots, telemetry) = slots(4, 100);
        let take = |last: u8| slots.take(IpAddr::from([192, 0, 2, last])).unwrap();
        let one = take(1);
        let many = [take(2), take(2), take(2)];
        many[0].activity().leave_http();
        assert!(take(3).is_reserved(), "none was idle for long");
        tokio::time::advance(SPARE_IDLE).await;
        // The oldest that is idle: the first is a WebSocket now.
        let new = take(3);
        assert!(!new.is_reserved());
        let is_cut = async |slot: &ConnectionSlot| {
            let cut = slot.activity().is_cut();
            tokio::time::timeout(Duration::from_millis(1), cut).await.is_ok()
        };
        assert!(is_cut(&many[1]).await);
        assert!(!is_cut(&many[0]).await && !is_cut(&many[2]).await && !is_cut(&one).await);
        drop((one, many, new));
        let taken = slots.taken();
        assert_eq!((taken.slots, taken.reserve, taken.addresses.len()), (0, 0, 0));
        let line = "troupe_connections_made_room_total 1";
        assert!(telemetry.render().contains(line));
    }

    #[tokio::test(start_paused = true)]
    async fn silent_connections_do_not_hold_the_reserve() {
        let (slots, _) = slots(1, 100);
        let from = |last: u8| slots.take(IpAddr::from([192, 0, 2, last]));
        let _silent: Vec<_> = (0..1 + RESERVE as u8).map(|last| from(last).unwrap()).collect();
        assert_eq!(from(100).unwrap_err(), ConnectionRefusal::Full);
        tokio::time::advance(RESERVE_SPARE_IDLE).await;
        assert!(from(100).unwrap().is_reserved());
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
