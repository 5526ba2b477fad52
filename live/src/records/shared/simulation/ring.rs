//! The server to which HAProxy sends a key: a model of the router of deploy/cluster/haproxy.cfg.
//!
//! HAProxy's configuration manual has the rule under `hash-type consistent`: a tree has many
//! points of each server, the server closest to the hash of a key gets it, and the hash is `sdbm`
//! with `avalanche`. How the points are made is in HAProxy's `src/lb_chash.c`. tests/cluster
//! compares HAProxy itself with the places that a test here expects.

/// Weight of each server in haproxy.cfg.
const WEIGHT: u32 = 100;
/// Points of a server for one unit of its weight.
const POINTS_OF_WEIGHT: u32 = 16;
/// Numbers of points from one server to the next: the largest weight is 256.
const POINTS_OF_SERVER: u32 = 256 * POINTS_OF_WEIGHT;

#[derive(Clone, Copy)]
struct Point {
    hash: u32,
    server: u32,
}

/// The points of all servers, by their hashes.
pub(super) struct Ring(Vec<Point>);

impl Ring {
    pub(super) fn new(servers: usize) -> Self {
        let servers = u32::try_from(servers).unwrap();
        let of_server = |server| {
            // HAProxy counts servers from 1.
            let first = (server + 1) * POINTS_OF_SERVER;
            (0..WEIGHT * POINTS_OF_WEIGHT).map(move |nth| Point {
                hash: avalanche(first + nth),
                server,
            })
        };
        let mut points: Vec<Point> = (0..servers).flat_map(of_server).collect();
        points.sort_unstable_by_key(|point| point.hash);
        Self(points)
    }

    /// The server of a key. `None`: no server is up.
    pub(super) fn route(&self, key: &str, is_up: impl Fn(usize) -> bool) -> Option<usize> {
        let hash = avalanche(sdbm(key));
        let at = self.0.partition_point(|point| point.hash < hash);
        let (below, above) = self.0.split_at(at);
        let counts = |point: &&Point| is_up(point.server as usize);
        let next = above.iter().chain(below).find(counts)?;
        let last = below.iter().rev().chain(above.iter().rev()).find(counts)?;
        let (back, ahead) = (hash.wrapping_sub(last.hash), next.hash.wrapping_sub(hash));
        Some(if back <= ahead { last.server } else { next.server } as usize)
    }
}

fn sdbm(key: &str) -> u32 {
    key.bytes().fold(0u32, |hash, byte| {
        u32::from(byte)
            .wrapping_add(hash << 6)
            .wrapping_add(hash << 16)
            .wrapping_sub(hash)
    })
}

/// HAProxy's `full_hash`.
fn avalanche(hash: u32) -> u32 {
    let mut a = hash;
    a = a.wrapping_add(0x7ed5_5d16).wrapping_add(a << 12);
    a = (a ^ 0xc761_c23c) ^ (a >> 19);
    a = a.wrapping_add(0x1656_67b1).wrapping_add(a << 5);
    a = a.wrapping_add(0xd3a2_646c) ^ (a << 9);
    a = a.wrapping_add(0xfd70_46c5).wrapping_add(a << 3);
    a = (a ^ 0xb55a_4f09) ^ (a >> 16);
    a.wrapping_mul(3_221_225_473)
}

#[cfg(test)]
mod tests {
    use std::collections::{BTreeMap, BTreeSet};

    use super::*;

    /// Servers of `hero-0` to `hero-89` among three: of all three, and without the second.
    const PLACES: &str = include_str!("../../../../../tests/cluster/haproxy-places.txt");
    const PLANNING: &str = include_str!("../../../../../docs/planning.md");

    fn places(ring: &Ring, keys: usize, is_up: impl Fn(usize) -> bool) -> Vec<usize> {
        (0..keys)
            .map(|key| ring.route(&format!("npc-{key}"), &is_up).unwrap())
            .collect()
    }

    #[test]
    fn the_model_places_sessions_as_haproxy_does() {
        let ring = Ring::new(3);
        let shown = |is_up: fn(usize) -> bool| -> String {
            let servers = (0..90).map(|key| ring.route(&format!("hero-{key}"), is_up).unwrap());
            servers.map(|server| server.to_string()).collect()
        };
        let shown = [shown(|_| true), shown(|server| server != 1)];
        assert_eq!(PLACES.lines().collect::<Vec<_>>(), shown);
        assert_eq!(ring.route("hero-0", |_| false), None);
    }

    #[test]
    fn the_busiest_server_is_the_one_of_the_page_that_plans() {
        for servers in [3, 24, 1000] {
            let mut sessions = vec![0u32; servers];
            for place in places(&Ring::new(servers), 100 * servers, |_| true) {
                sessions[place] += 1;
            }
            let busiest = f64::from(*sessions.iter().max().unwrap()) / 100.0;
            let begin = format!("| {servers} | ");
            let row = PLANNING.lines().find(|line| line.starts_with(&begin)).unwrap();
            assert!(row.ends_with(&format!(" | {busiest:.2} |")), "{busiest}: {row}");
        }
    }

    #[test]
    fn only_the_keys_of_dead_servers_move_and_they_come_back() {
        let ring = Ring::new(1000);
        let is_dead = |server: usize| server % 100 == 7;
        let before = places(&ring, 20_000, |_| true);
        let during = places(&ring, 20_000, |server| !is_dead(server));
        assert_eq!(places(&ring, 20_000, |_| true), before);
        let mut heirs: BTreeMap<usize, BTreeSet<usize>> = BTreeMap::new();
        for (&from, &to) in before.iter().zip(&during) {
            assert!(!is_dead(to) && (from == to || is_dead(from)), "{from} to {to}");
            if is_dead(from) {
                heirs.entry(from).or_default().insert(to);
            }
        }
        // Each of the ten has about 20 keys, and others than its neighbours get them.
        assert_eq!(heirs.len(), 10);
        assert!(heirs.values().all(|heirs| heirs.len() >= 8), "{heirs:?}");
    }
}
