//! The uploads of all servers, as a log in Redis.
//!
//! | key | holds |
//! |---|---|
//! | `troupe:{uploads}:head` | `version`: of the newest change; `epoch`: version of the first change; `floor`: newest change that the log has forgotten |
//! | `troupe:{uploads}:log` | fields, sorted by the version of their newest change (`position`) |
//! | `troupe:{uploads}:ranks` | by field: version of the upload or removal, which stays if it is written again |
//! | `troupe:{uploads}:records` | by field: the upload; missing once it is removed |
//! | `troupe:{uploads}:removed` | removed fields, sorted by version |
//!
//! Versions are the time of Redis in microseconds, or one more than the version before, as tokens
//! of leases are. So they rise even if Redis has lost everything, and of two uploads the later one
//! has the higher rank. All keys have one hash tag, so a cluster has them on one node.
//!
//! A write names the rank that it replaces. One that comes late, on a connection that its server
//! gave up after a timeout, finds another rank and changes nothing.

use redis::{Cmd, ErrorKind, FromRedisValue, RedisError, Value, cmd};

use super::super::RecordsError;
use super::link::{Link, Place};

const KEYS: [&str; 5] = [
    "troupe:{uploads}:head",
    "troupe:{uploads}:log",
    "troupe:{uploads}:ranks",
    "troupe:{uploads}:records",
    "troupe:{uploads}:removed",
];
/// Removals that are remembered, so that servers learn of them.
const MAX_REMOVED: usize = 4096;
/// Changes that one script lists.
const PAGE: usize = 512;
/// Tries to write an upload that others write at the same time.
const TRIES: usize = 4;

/// Writes or removes an upload, or writes it again.
const WRITE: &str = r"
local time = redis.call('TIME')
local us = time[1] * 1000000 + time[2]
local function text(n) return string.format('%.0f', n) end
local name, expected, rank = ARGV[1], ARGV[2], ARGV[3]
local there = redis.call('HGET', KEYS[3], name) or '0'
if expected == 'again' then
  if tonumber(there) >= tonumber(rank) then return {'other', there, '0'} end
elseif there ~= expected then return {'other', there, '0'} end
local head = redis.call('HMGET', KEYS[1], 'version', 'epoch')
local version = text(math.max(tonumber(head[1] or '0') + 1, tonumber(rank) + 1, tonumber(there) + 1, us))
if expected ~= 'again' then rank = version end
redis.call('HSET', KEYS[1], 'version', version)
if not head[2] then redis.call('HSET', KEYS[1], 'epoch', version, 'floor', '0') end
redis.call('ZADD', KEYS[2], version, name)
redis.call('HSET', KEYS[3], name, rank)
if ARGV[5] then
  redis.call('HSET', KEYS[4], name, ARGV[5])
  redis.call('ZREM', KEYS[5], name)
else
  redis.call('HDEL', KEYS[4], name)
  redis.call('ZADD', KEYS[5], version, name)
  local most = redis.call('ZCARD', KEYS[5]) - ARGV[4]
  if most > 0 then
    local old = redis.call('ZRANGE', KEYS[5], 0, most - 1, 'WITHSCORES')
    for i = 1, #old, 2 do
      redis.call('ZREM', KEYS[5], old[i])
      redis.call('ZREM', KEYS[2], old[i])
      redis.call('HDEL', KEYS[3], old[i])
      redis.call('HSET', KEYS[1], 'floor', text(tonumber(old[i + 1])))
    end
  end
end
return {'done', rank, version}
";

/// Lists changes after a version.
const SINCE: &str = r"
local head = redis.call('HMGET', KEYS[1], 'epoch', 'floor', 'version')
local found = redis.call('ZRANGEBYSCORE', KEYS[2], '(' .. ARGV[1], '+inf', 'WITHSCORES', 'LIMIT', 0, ARGV[2])
local answer = {head[1] or '0', head[2] or '0', head[3] or '0'}
for i = 1, #found, 2 do
  answer[#answer + 1] = found[i]
  answer[#answer + 1] = string.format('%.0f', tonumber(found[i + 1]))
  answer[#answer + 1] = redis.call('HGET', KEYS[3], found[i]) or '0'
  answer[#answer + 1] = tostring(redis.call('HSTRLEN', KEYS[4], found[i]))
end
return answer
";

/// An upload to write.
#[derive(Debug)]
pub struct Write {
    /// What the store calls it.
    pub field: String,
    /// The rank that this server knows of it. 0: none.
    pub rank: u64,
    /// The upload. `None` removes it.
    pub record: Option<Vec<u8>>,
}

/// A version of an upload in the log.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Version {
    /// Of the upload or removal.
    pub rank: u64,
    /// In the log.
    pub position: u64,
}

/// A change of an upload.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Change {
    /// What the store calls it.
    pub field: String,
    /// Its version.
    pub at: Version,
    /// Size of the upload. `None`: it is removed.
    pub bytes: Option<usize>,
}

/// What the log lists.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Changes {
    /// Differs after the store has lost everything. 0: nothing was ever written.
    pub epoch: u64,
    /// Removals up to this version are forgotten.
    pub floor: u64,
    /// Of the newest change.
    pub version: u64,
    /// By their versions.
    pub list: Vec<Change>,
}

/// The uploads of all servers. All calls block.
#[derive(Debug)]
pub struct UploadLog {
    link: Link,
}

impl UploadLog {
    pub(super) fn new(place: Place) -> Self {
        Self {
            link: Link::new(place),
        }
    }

    /// Writes uploads, each in the place of what the store has. Answers with their versions, in the
    /// same order. `None`: other servers write it all the time.
    ///
    /// # Errors
    /// [`RecordsError::Shared`]. Each upload may have been written or not.
    pub fn write(&mut self, writes: &[Write]) -> Result<Vec<Option<Version>>, RecordsError> {
        let mut done = vec![None; writes.len()];
        let mut expected: Vec<String> = writes.iter().map(|write| write.rank.to_string()).collect();
        for _ in 0..TRIES {
            let open: Vec<usize> = (0..writes.len()).filter(|&index| done[index].is_none()).collect();
            let scripts = open.iter().map(|&index| script(&writes[index], &expected[index]));
            let answers = self.link.ask(scripts.collect())?;
            for (&index, answer) in open.iter().zip(answers) {
                match self.link.read(answer, written)? {
                    Written::Done(at) => done[index] = Some(at),
                    Written::Other(rank) => expected[index] = rank,
                }
            }
        }
        Ok(done)
    }

    /// Writes uploads again after the store has lost them, unless it has the same or newer ones.
    ///
    /// # Errors
    /// [`RecordsError::Shared`]. Each upload may have been written or not.
    pub fn write_again(&mut self, writes: &[Write]) -> Result<(), RecordsError> {
        let scripts = writes.iter().map(|write| script(write, "again"));
        for answer in self.link.ask(scripts.collect())? {
            self.link.read(answer, written)?;
        }
        Ok(())
    }

    /// The changes after `position`.
    ///
    /// # Errors
    /// [`RecordsError::Shared`].
    pub fn since(&mut self, position: u64) -> Result<Changes, RecordsError> {
        let mut all = Changes::default();
        let mut after = position;
        loop {
            let mut script = eval(SINCE);
            script.arg(after).arg(PAGE);
            let answer = self.link.ask(vec![script])?.pop().unwrap_or(Value::Nil);
            let page = self.link.read(answer, listed)?;
            let is_last = page.list.len() < PAGE;
            if after != position && page.epoch != all.epoch {
                // Emptied by now, which the next call sees.
                return Ok(all);
            }
            after = page.list.last().map_or(after, |change| change.at.position);
            all.list.extend(page.list);
            (all.epoch, all.floor, all.version) = (page.epoch, page.floor, page.version);
            if is_last {
                return Ok(all);
            }
        }
    }

    /// Uploads, in the order of `fields`. `None`: removed.
    ///
    /// # Errors
    /// [`RecordsError::Shared`].
    pub fn records(&mut self, fields: &[String]) -> Result<Vec<Option<Vec<u8>>>, RecordsError> {
        if fields.is_empty() {
            return Ok(Vec::new());
        }
        let mut get = cmd("HMGET");
        get.arg(KEYS[3]).arg(fields);
        let answer = self.link.ask(vec![get])?.pop().unwrap_or(Value::Nil);
        self.link.read(answer, |value| Ok(Vec::from_redis_value(value)?))
    }
}

fn eval(script: &str) -> Cmd {
    let mut eval = cmd("EVAL");
    eval.arg(script).arg(KEYS.len()).arg(&KEYS[..]);
    eval
}

fn script(write: &Write, expected: &str) -> Cmd {
    let mut script = eval(WRITE);
    script
        .arg(&write.field)
        .arg(expected)
        .arg(write.rank)
        .arg(MAX_REMOVED);
    if let Some(record) = &write.record {
        script.arg(record.as_slice());
    }
    script
}

/// What became of a write.
enum Written {
    Done(Version),
    /// The store has this rank.
    Other(String),
}

fn unknown() -> RedisError {
    RedisError::from((ErrorKind::UnexpectedReturnType, "an answer of another script"))
}

fn number(text: &str) -> Result<u64, RedisError> {
    text.parse().map_err(|_| unknown())
}

fn written(value: Value) -> Result<Written, RedisError> {
    let parts: Vec<String> = Vec::from_redis_value(value)?;
    match parts.as_slice() {
        [what, rank, position] if what == "done" => Ok(Written::Done(Version {
            rank: number(rank)?,
            position: number(position)?,
        })),
        [what, rank, _] if what == "other" => Ok(Written::Other(rank.clone())),
        _ => Err(unknown()),
    }
}

fn listed(value: Value) -> Result<Changes, RedisError> {
    let parts: Vec<String> = Vec::from_redis_value(value)?;
    let [epoch, floor, version, list @ ..] = parts.as_slice() else {
        return Err(unknown());
    };
    let change = |parts: &[String]| match parts {
        [field, position, rank, bytes] => {
            let bytes = usize::try_from(number(bytes)?).map_err(|_| unknown())?;
            Ok(Change {
                field: field.clone(),
                at: Version {
                    rank: number(rank)?,
                    position: number(position)?,
                },
                bytes: (bytes > 0).then_some(bytes),
            })
        }
        _ => Err(unknown()),
    };
    Ok(Changes {
        epoch: number(epoch)?,
        floor: number(floor)?,
        version: number(version)?,
        list: list.chunks(4).map(change).collect::<Result<_, _>>()?,
    })
}

#[cfg(test)]
#[path = "uploads_tests.rs"]
mod tests;
