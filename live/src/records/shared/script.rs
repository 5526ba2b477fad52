//! The scripts that Redis runs. Each is atomic and has one key, so it also runs in a cluster.
//!
//! A key is a hash with the fields
//!
//! | field | meaning |
//! |---|---|
//! | `token` | of the newest lease. It rises with every lease of the key |
//! | `rank` | the token that its owner got when it last took the key over from another |
//! | `owner` | address of the owner |
//! | `until` | end of the lease by the clock of Redis, ms |
//! | `keep` | time for which the record counts after the lease, ms; -1: for ever |
//! | `record` | the state; missing before the first write and after the end |
//! | `number` | of the newest request of the owner. An older one has come late, and changes nothing |
//!
//! A token is the time of Redis in microseconds, or one more than the token before: so it rises
//! even if Redis has lost everything. It is below 2^53, up to which Lua's numbers are exact.
//!
//! A request may come late, on a connection that its server gave up after a timeout: hence
//! `number`.

use redis::{Cmd, ErrorKind, FromRedisValue, RedisError, Value, cmd};

/// Takes a lease if no server has one.
const CLAIM: &str = r"
local time = redis.call('TIME')
local us = time[1] * 1000000 + time[2]
local ms = math.floor(us / 1000)
local function text(n) return string.format('%.0f', n) end
local at = redis.call('HMGET', KEYS[1], 'token', 'owner', 'until', 'keep', 'record')
local ends = tonumber(at[3] or '0')
if ends > ms then return {'elsewhere', at[2], text(ends - ms)} end
local keep = tonumber(at[4] or '0')
local counts = at[5] and (keep < 0 or ends + keep >= ms)
if ARGV[3] == 'new' and counts then return {'exists'} end
if ARGV[3] == 'known' and not counts then return {'unknown'} end
local token = text(math.max(tonumber(at[1] or '0') + 1, us))
redis.call('HSET', KEYS[1], 'token', token, 'rank', token, 'owner', ARGV[1], 'until', text(ms + ARGV[2]), 'number', '0')
if not counts then redis.call('HDEL', KEYS[1], 'record') end
if keep < 0 then return {'taken', token, counts and at[5] or false, text(keep)} end
redis.call('PEXPIRE', KEYS[1], text(ARGV[2] + math.max(keep, ARGV[4] + 0)))
return {'taken', token, counts and at[5] or false, text(keep)}
";

/// Does something with a lease, if its token is still the caller's.
const HOLD: &str = r"
local time = redis.call('TIME')
local us = time[1] * 1000000 + time[2]
local ms = math.floor(us / 1000)
local function text(n) return string.format('%.0f', n) end
local what, mine, rank = ARGV[1], ARGV[4], ARGV[5]
local at = redis.call('HMGET', KEYS[1], 'token', 'rank', 'owner', 'until', 'number')
local answer = {'kept'}
if at[1] == mine and tonumber(at[5] or '0') >= tonumber(ARGV[9]) then return answer end
if at[1] ~= mine then
  local free = not at[1] and ARGV[6] == '1'
  local later = at[1] and tonumber(at[2]) < tonumber(rank)
  if what == 'remove' or what == 'release' or not (free or later) then
    return {'lost', at[3] or '', text(math.max(tonumber(at[4] or '0') - ms, 0))}
  end
  mine = text(math.max(tonumber(at[1] or '0') + 1, tonumber(mine) + 1, us))
  answer = {'taken', mine, false, ARGV[7]}
end
local ends = ms + ARGV[3]
if what == 'remove' or what == 'release' then ends = ms end
if what == 'remove' then redis.call('HDEL', KEYS[1], 'record') end
redis.call('HSET', KEYS[1], 'token', mine, 'rank', rank, 'owner', ARGV[2], 'until', text(ends), 'keep', ARGV[7],
  'number', ARGV[9])
if what == 'write' then redis.call('HSET', KEYS[1], 'record', ARGV[10]) end
if ARGV[7] + 0 < 0 and what ~= 'remove' then redis.call('PERSIST', KEYS[1])
else redis.call('PEXPIRE', KEYS[1], text(ends - ms + math.max(ARGV[7] + 0, ARGV[8] + 0))) end
return answer
";

/// Says which server has a lease.
const LOOK: &str = r"
local time = redis.call('TIME')
local ms = math.floor((time[1] * 1000000 + time[2]) / 1000)
local at = redis.call('HMGET', KEYS[1], 'owner', 'until')
local ends = tonumber(at[2] or '0')
if ends > ms then return {'elsewhere', at[1], string.format('%.0f', ends - ms)} end
return {'unknown'}
";

/// Says whether the store was empty a moment ago. The key has the time at which this was first
/// asked, ms. Servers ask in every round.
const FILLING: &str = r"
local time = redis.call('TIME')
local ms = math.floor((time[1] * 1000000 + time[2]) / 1000)
redis.call('SET', KEYS[1], string.format('%.0f', ms), 'NX')
if ms - redis.call('GET', KEYS[1]) < ARGV[1] + 0 then return {'filling'} end
return {'kept'}
";

/// What a claim is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Want {
    /// To make something new: there must be no record.
    New,
    /// To restore something: there must be a record.
    Known,
    /// Either.
    Any,
}

/// What to do with a lease.
#[derive(Debug, Clone, Copy)]
pub(super) enum Hold<'a> {
    /// Write the record, and renew the lease.
    Write(&'a [u8]),
    /// Renew the lease.
    Renew,
    /// End the lease, and remove the record. The token stays for a while.
    Remove,
    /// End the lease now. The record stays.
    Release,
}

/// What Redis did.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Answer {
    /// The lease was this server's, and is.
    Kept,
    /// The lease is this server's from now on.
    Taken {
        token: u64,
        record: Option<Vec<u8>>,
        /// As [`Mine::keep`].
        keep: Option<u64>,
    },
    /// Another server has a lease, or had one after this server's. Nothing has changed.
    Lost { owner: String, ends_in_ms: u64 },
    /// There is a record, and no server has a lease.
    Exists,
    /// There is no record.
    Unknown,
    /// The store was empty a moment ago.
    Filling,
}

/// Times that a script needs, ms.
#[derive(Debug, Clone, Copy)]
pub(super) struct Times {
    /// Length of a lease.
    pub(super) lease: u64,
    /// Time for which a token is remembered after its lease.
    pub(super) remember: u64,
}

/// Takes a lease that no server has.
pub(super) fn claim(key: &str, address: &str, want: Want, times: Times) -> Cmd {
    let mut eval = cmd("EVAL");
    eval.arg(CLAIM).arg(1).arg(key).arg(address).arg(times.lease);
    eval.arg(match want {
        Want::New => "new",
        Want::Known => "known",
        Want::Any => "any",
    });
    eval.arg(times.remember);
    eval
}

/// Looks which server has a lease. Nothing changes.
pub(super) fn look(key: &str) -> Cmd {
    let mut eval = cmd("EVAL");
    eval.arg(LOOK).arg(1).arg(key);
    eval
}

/// Asks whether the store was empty in the last `fill_ms`.
pub(super) fn filling(fill_ms: u64) -> Cmd {
    let mut eval = cmd("EVAL");
    eval.arg(FILLING).arg(1).arg("troupe:since").arg(fill_ms);
    eval
}

/// This server's lease, as the script must know it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Mine {
    pub(super) token: u64,
    pub(super) rank: u64,
    /// Whether it may be taken again if Redis knows nothing of it.
    pub(super) may_take: bool,
    /// Time for which the record counts after the lease, ms. `None`: for ever.
    pub(super) keep: Option<u64>,
    /// Rises with every request.
    pub(super) number: u64,
}

/// Does something with this server's lease.
pub(super) fn hold(key: &str, address: &str, mine: Mine, hold: Hold<'_>, times: Times) -> Cmd {
    let mut eval = cmd("EVAL");
    eval.arg(HOLD).arg(1).arg(key);
    eval.arg(match hold {
        Hold::Write(_) => "write",
        Hold::Renew => "renew",
        Hold::Remove => "remove",
        Hold::Release => "release",
    });
    eval.arg(address).arg(times.lease).arg(mine.token).arg(mine.rank);
    eval.arg(u8::from(mine.may_take));
    match mine.keep {
        Some(keep) => eval.arg(keep),
        None => eval.arg(-1),
    };
    eval.arg(times.remember).arg(mine.number);
    if let Hold::Write(record) = hold {
        eval.arg(record);
    }
    eval
}

/// Reads the answer of a script.
pub(super) fn read(value: Value) -> Result<Answer, RedisError> {
    let unknown = || RedisError::from((ErrorKind::UnexpectedReturnType, "an answer of another script"));
    let Value::Array(parts) = value else {
        return Err(unknown());
    };
    let mut parts = parts.into_iter();
    let mut next = || parts.next().ok_or_else(unknown);
    let number = |value: Value| -> Result<u64, RedisError> {
        String::from_redis_value(value)?.parse().map_err(|_| unknown())
    };
    Ok(match String::from_redis_value(next()?)?.as_str() {
        "kept" => Answer::Kept,
        "taken" => Answer::Taken {
            token: number(next()?)?,
            record: Option::<Vec<u8>>::from_redis_value(next()?)?,
            // -1 is no number here.
            keep: number(next()?).ok(),
        },
        "lost" | "elsewhere" => Answer::Lost {
            owner: String::from_redis_value(next()?)?,
            ends_in_ms: number(next()?)?,
        },
        "exists" => Answer::Exists,
        "unknown" => Answer::Unknown,
        "filling" => Answer::Filling,
        _ => return Err(unknown()),
    })
}
