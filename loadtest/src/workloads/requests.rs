//! Requests, which are generated and encoded before the load begins.

use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};

use bytes::Bytes;
use prost::Message as _;
use serde::Deserialize;
use troupe_client::{Client, InBetween, Pack};
use troupe_motion::bvh::{self, BvhOptions};
use troupe_motion::clip::Clip;
use troupe_proto::v1;

use super::answer::Expected;
use crate::failure::Failure;
use crate::plan::{Plan, Protocol, Requests};

/// A walk on the default pack's skeleton.
const WALK: &[u8] = include_bytes!("../../../examples/walk.bvh");
/// The supported version of `requests.json`.
const FOLDER_VERSION: u32 = 1;

/// One request, ready to be sent.
#[derive(Debug, Clone)]
pub struct Item {
    /// Bytes to send.
    pub body: Bytes,
    /// Number of characters.
    pub characters: u32,
    /// Number of frames in a right answer, of all characters together. `None` if the model chooses
    /// it.
    pub frames: Option<u64>,
    /// Length of a right answer, if known.
    pub answer_bytes: Option<u64>,
    /// The decoded request, to check answers against. `None` for other servers.
    pub request: Option<v1::InBetweenRequest>,
}

impl Item {
    pub(super) fn expected(&self) -> Expected {
        Expected {
            characters: self.characters,
            frames: self.frames,
        }
    }
}

/// All requests of a load, which are sent in turn.
#[derive(Debug)]
pub struct RequestSet {
    items: Vec<Item>,
    verify_every: u64,
    verified: AtomicU64,
}

impl RequestSet {
    /// Makes a set of requests. `None` if `items` is empty.
    pub fn new(items: Vec<Item>, verify_every: u32) -> Option<Self> {
        (!items.is_empty()).then(|| Self {
            items,
            verify_every: verify_every.into(),
            verified: AtomicU64::new(0),
        })
    }

    pub(super) fn item(&self, number: u64) -> &Item {
        &self.items[(number % self.items.len() as u64) as usize]
    }

    /// Whether to fully check answer number `number`.
    pub(super) fn is_sample(&self, number: u64) -> bool {
        self.verify_every > 0 && number.is_multiple_of(self.verify_every)
    }

    pub(super) fn note_verified(&self) {
        self.verified.fetch_add(1, Ordering::Relaxed);
    }

    /// Number of right answers that were fully checked.
    pub(super) fn verified(&self) -> u64 {
        self.verified.load(Ordering::Relaxed)
    }
}

/// Generates or reads the requests of a plan, in the form of its protocol.
pub(super) async fn load(plan: &Plan, protocol: &Protocol, of: &Requests) -> Result<RequestSet, Failure> {
    let items = match &of.folder {
        Some(folder) => from_folder(folder, protocol)?,
        None if matches!(protocol, Protocol::Http { .. }) => {
            return Err(Failure::Input(
                "--workload http needs --requests FOLDER, which has the bodies to send".to_owned(),
            ));
        }
        None => {
            let client = Client::connect_with(&plan.server, plan.access.options()).await?;
            let pack = client.pack(&of.pack).await?;
            let clip = read_clip(of.clip.as_deref(), &pack)?;
            made(&clip, &pack, of, plan.seed)?
                .into_iter()
                .map(|request| encoded(request, protocol))
                .collect::<Result<_, _>>()?
        }
    };
    RequestSet::new(items, of.verify_every)
        .ok_or_else(|| Failure::Input("there are no requests to send".to_owned()))
}

/// Encodes a request in the form of its protocol.
fn encoded(request: v1::InBetweenRequest, protocol: &Protocol) -> Result<Item, Failure> {
    let body = match protocol {
        Protocol::Json => serde_json::to_vec(&request)
            .map_err(|e| Failure::Other(format!("cannot write a request: {e}")))?,
        Protocol::Grpc | Protocol::Http { .. } => request.encode_to_vec(),
    };
    let frames = request
        .characters
        .iter()
        .map(|character| character.frame_count.map(u64::from))
        .sum::<Option<u64>>();
    Ok(Item {
        body: body.into(),
        characters: u32::try_from(request.characters.len()).unwrap_or(u32::MAX),
        frames,
        answer_bytes: None,
        request: Some(request),
    })
}

fn read_clip(path: Option<&Path>, pack: &Pack) -> Result<Clip, Failure> {
    let fault = |why: String| match path {
        Some(path) => Failure::file(path, why),
        None => Failure::Input(format!(
            "the built-in walk does not fit the pack {:?}; set another clip with --clip: {why}",
            pack.name()
        )),
    };
    let bytes = match path {
        Some(path) => std::fs::read(path).map_err(|e| fault(e.to_string()))?,
        None => WALK.to_vec(),
    };
    let file = bvh::parse_bytes(&bytes).map_err(|e| fault(e.to_string()))?;
    // The default unit is the centimetre, as in most BVH files. Bones may differ from the pack's.
    let options = BvhOptions {
        max_offset_error_m: f32::INFINITY,
        ..BvhOptions::default()
    };
    let clip = file
        .to_clip_on(pack.skeleton(), &options)
        .map_err(|e| fault(e.to_string()))?;
    if (clip.fps - pack.fps()).abs() < 1e-2 {
        return Ok(Clip {
            fps: pack.fps(),
            ..clip
        });
    }
    clip.resample(pack.fps()).map_err(|e| fault(e.to_string()))
}

/// Generates requests. Their keyframes begin at different frames of the clip.
fn made(clip: &Clip, pack: &Pack, of: &Requests, seed: u64) -> Result<Vec<v1::InBetweenRequest>, Failure> {
    let length = of.frames as usize;
    let allowed = pack.segment_frames();
    if !allowed.contains(&length) {
        return Err(Failure::option(
            "--frames",
            length,
            format_args!("{} to {}", allowed.start(), allowed.end()),
        ));
    }
    let context = pack.context_frames();
    let starts = (clip.frames() + 1).saturating_sub(length) as u64;
    if starts == 0 {
        return Err(Failure::Input(format!(
            "the clip has {} frames; allowed: at least --frames, {length}",
            clip.frames()
        )));
    }
    let character = |number: u64| {
        // The stride of 7 visits every start before it repeats one, unless the number of starts is
        // a multiple of 7.
        let start = (number.wrapping_mul(7) % starts) as usize;
        let gap = InBetween::from_clip(clip, start + context - 1, start + length - 1)?
            .id(number.to_string())
            .seed(seed.wrapping_add(number))
            .temperature(of.temperature);
        gap.to_message(pack)
    };
    let requests = (0..u64::from(of.variants.max(1))).map(|variant| {
        let first = variant * u64::from(of.characters);
        let characters = (first..first + u64::from(of.characters)).map(character);
        Ok(v1::InBetweenRequest {
            pack: pack.name().to_owned(),
            characters: characters
                .collect::<Result<_, _>>()
                .map_err(troupe_client::ClientError::Request)?,
            skeleton: pack.worn().to_owned(),
        })
    });
    requests.collect()
}

#[derive(Debug, Deserialize)]
struct Folder {
    version: u32,
    requests: Vec<FolderItem>,
}

#[derive(Debug, Deserialize)]
struct FolderItem {
    /// File of a serialised `troupe.v1.InBetweenRequest`.
    grpc: Option<String>,
    /// File of the same request's body for a plain HTTP server.
    body: Option<String>,
    /// Number of frames in a right answer.
    frames: Option<u64>,
    /// Length of a right answer over plain HTTP.
    answer_bytes: Option<u64>,
}

/// Reads prepared requests.
fn from_folder(folder: &Path, protocol: &Protocol) -> Result<Vec<Item>, Failure> {
    let path = folder.join("requests.json");
    let text = std::fs::read_to_string(&path).map_err(|e| Failure::file(&path, e))?;
    let list: Folder = serde_json::from_str(&text).map_err(|e| Failure::file(&path, e))?;
    if list.version != FOLDER_VERSION {
        let version = list.version;
        return Err(Failure::file(
            &path,
            format_args!("version is {version}; allowed: {FOLDER_VERSION}"),
        ));
    }
    let plain = matches!(protocol, Protocol::Http { .. });
    let items = list.requests.iter().enumerate().map(|(nth, item)| {
        let (field, name) = if plain {
            ("body", &item.body)
        } else {
            ("grpc", &item.grpc)
        };
        let name = name
            .as_ref()
            .ok_or_else(|| Failure::file(&path, format_args!("requests[{nth}].{field} is missing")))?;
        let file = folder.join(name);
        let bytes = std::fs::read(&file).map_err(|e| Failure::file(&file, e))?;
        if plain {
            return Ok(Item {
                body: bytes.into(),
                characters: 1,
                frames: item.frames,
                answer_bytes: item.answer_bytes,
                request: None,
            });
        }
        let request = v1::InBetweenRequest::decode(bytes.as_slice())
            .map_err(|e| Failure::file(&file, format_args!("this is not an InBetweenRequest: {e}")))?;
        let made = encoded(request, protocol)?;
        Ok(Item {
            frames: item.frames.or(made.frames),
            ..made
        })
    });
    items.collect()
}

#[cfg(test)]
#[path = "requests_tests.rs"]
mod tests;
