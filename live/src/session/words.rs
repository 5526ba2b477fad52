//! Sentences that characters act out: the packs that make motion of them, and what a command may
//! ask of those.

use std::collections::BTreeMap;
use std::sync::Arc;

use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::task::JoinHandle;
use tokio_util::task::AbortOnDropHandle;
use troupe_proto::v1;

use super::SessionError;
use crate::packs::{CannotDo, LoadedPack, PackTable, UnknownPack};
use crate::wire::{MAX_TEMPERATURE, units};
use troupe_character::live::{
    MAX_PAST_FRAMES, MAX_PERFORMANCE_FRAMES, MAX_UNKNOWN_WORDS, OtherSkeleton, PartReader, PerformCommand,
};
use troupe_character::{FieldError, Path};
use troupe_engine::pack::TaskRefusal;
use troupe_motion::model::{Capability, GLOBAL_ROOT, KeyTensors, PromptTask, Rig, SamplingTask, Task};

/// Shortest and longest performance that may be asked for, seconds.
const SECONDS: (f32, f32) = (0.5, 30.0);
/// Most characters of all tenants that perform at a time; one more is told so.
pub const MAX_PERFORMERS: usize = 512;
/// About the most memory that one of them takes beside its session, bytes: its frames wait there.
pub const PERFORMER_BYTES: u64 = 384 << 10;
/// Most characters of an unknown word that are told, and of a pack's name.
const MAX_ECHO: usize = 64;

/// A pack of words for the characters of another pack.
#[derive(Debug)]
pub struct WordsPack {
    /// The pack.
    pub loaded: Arc<LoadedPack>,
    /// Reads what it makes.
    pub reader: PartReader,
}

/// Why the characters of a pack cannot act out what another makes.
#[derive(Debug, Clone)]
enum WhyNot {
    /// It makes nothing of words.
    CannotDo(CannotDo),
    /// Its skeleton or rate is another.
    Skeleton(OtherSkeleton),
    /// It reads so many past frames.
    Past(usize),
}

/// Places for characters that perform; clones share them.
#[derive(Debug, Clone)]
pub struct Places(Arc<Semaphore>);

impl Default for Places {
    fn default() -> Self {
        Self(Arc::new(Semaphore::new(MAX_PERFORMERS)))
    }
}

impl Places {
    /// One of them, where there is one.
    pub fn take(&self) -> Option<OwnedSemaphorePermit> {
        self.0.clone().try_acquire_owned().ok()
    }
}

/// A stream of words, and a place for its frames. Dropping it gives up both.
#[derive(Debug)]
pub struct Performer {
    number: u64,
    _place: OwnedSemaphorePermit,
    _task: AbortOnDropHandle<()>,
}

impl Performer {
    /// The words of the command `number`, which `task` brings.
    pub(super) fn new(number: u64, place: OwnedSemaphorePermit, task: JoinHandle<()>) -> Self {
        Self {
            number,
            _place: place,
            _task: AbortOnDropHandle::new(task),
        }
    }

    /// Number of the command whose words it brings.
    pub fn number(&self) -> u64 {
        self.number
    }
}

/// All packs of a server, as what the characters of one of them can act out.
#[derive(Debug, Default)]
pub struct WordsPacks {
    /// Where they take a place for it.
    pub places: Places,
    by_name: BTreeMap<String, Result<WordsPack, WhyNot>>,
    /// Name of the pack for those who name none.
    default: Option<String>,
}

impl WordsPacks {
    /// Those of `table`, for characters of `own`, who take one of `places` each.
    pub fn new(table: &PackTable, own: &Arc<Rig>, places: &Places) -> Self {
        let named = |loaded: &Arc<LoadedPack>| (loaded.pack.name().to_owned(), words_pack(loaded, own));
        let by_name: BTreeMap<_, _> = table.all().map(named).collect();
        let fit = |loaded: &&Arc<LoadedPack>| matches!(by_name.get(loaded.pack.name()), Some(Ok(_)));
        let fitting = || table.all().filter(fit);
        let default = fitting().find(|loaded| table.is_default(loaded));
        let default = default.or_else(|| fitting().next());
        Self {
            places: places.clone(),
            default: default.map(|loaded| loaded.pack.name().to_owned()),
            by_name,
        }
    }

    /// The pack of that name, where characters can act out what it makes.
    pub fn get(&self, name: &str) -> Option<&WordsPack> {
        self.by_name.get(name)?.as_ref().ok()
    }

    /// Name of the pack for those who name none, where there is one.
    pub fn default_name(&self) -> Option<&str> {
        self.default.as_deref()
    }

    /// The pack that a request names in the field at `path`; the default where it names none.
    fn find(&self, path: &Path<'_>, name: &str) -> Result<&WordsPack, SessionError> {
        let allowed = || {
            let fit = self.by_name.iter().filter(|(_, pack)| pack.is_ok());
            let names: Vec<&str> = fit.map(|(name, _)| name.as_str()).collect();
            match names.is_empty() {
                true => {
                    "none: no pack of this server makes motion of words for the session's skeleton".to_owned()
                }
                false => names.join(", "),
            }
        };
        let name = match (name, &self.default) {
            ("", None) => return Err(path.error("is empty, and there is no default", allowed()).into()),
            ("", Some(default)) => default.as_str(),
            (name, _) => name,
        };
        match self.by_name.get(name) {
            Some(Ok(pack)) => Ok(pack),
            Some(Err(WhyNot::CannotDo(error))) => Err(CannotDo {
                field: path.to_string(),
                ..error.clone()
            }
            .into()),
            Some(Err(WhyNot::Skeleton(why))) => {
                Err(path.error(format!("is {name:?}: {why}"), allowed()).into())
            }
            Some(Err(WhyNot::Past(frames))) => {
                let message = format!("is {name:?}, which reads {frames} past frames");
                Err(path
                    .error(message, format!("packs that read at most {MAX_PAST_FRAMES}"))
                    .into())
            }
            None => Err(UnknownPack {
                name: name.chars().take(MAX_ECHO).collect(),
                field: path.to_string(),
                loaded: self.by_name.keys().cloned().collect(),
            }
            .into()),
        }
    }

    /// Checks a command.
    ///
    /// # Errors
    /// [`SessionError`] for the first value that is not accepted.
    pub fn command(&self, path: &Path<'_>, asked: &v1::Perform) -> Result<PerformCommand, SessionError> {
        units::sentence(&path.field("text"), &asked.text)?;
        let pack = self.find(&path.field("pack"), &asked.pack)?;
        let (shortest, longest) = SECONDS;
        let seconds = |value| units::within(&path.field("seconds"), value, shortest, longest);
        let temperature = |value| units::within(&path.field("temperature"), value, 0.0, MAX_TEMPERATURE);
        let seconds = asked.seconds.map(seconds).transpose()?;
        let frames = seconds.map(|seconds| (seconds * pack.loaded.pack.rig.fps).round() as u32);
        let command = PerformCommand {
            text: Arc::from(asked.text.as_str()),
            pack: Arc::from(pack.loaded.pack.name()),
            past_frames: pack.loaded.pack.rig.dims.context_frames as u32,
            frames: frames.map(|frames| frames.clamp(1, MAX_PERFORMANCE_FRAMES)),
            temperature: asked.temperature.map(temperature).transpose()?,
            unknown_words: pack.unknown_words(&asked.text),
        };
        pack.check(path, &command)?;
        Ok(command)
    }
}

fn words_pack(loaded: &Arc<LoadedPack>, own: &Arc<Rig>) -> Result<WordsPack, WhyNot> {
    loaded.require(Capability::Text, "").map_err(WhyNot::CannotDo)?;
    let rig = &loaded.pack.rig;
    let past = rig.dims.context_frames;
    if past > MAX_PAST_FRAMES as usize {
        return Err(WhyNot::Past(past));
    }
    Ok(WordsPack {
        reader: PartReader::new(rig, own).map_err(WhyNot::Skeleton)?,
        loaded: loaded.clone(),
    })
}

/// The task of a command, which goes on from `past`.
pub(super) fn task(command: &PerformCommand, past: Vec<KeyTensors>, seed: u64) -> Task {
    Task::Prompt(PromptTask {
        text: command.text.to_string(),
        context: past,
        frames: command.frames.map(|frames| frames as usize),
        seed,
        sampling: SamplingTask {
            temperature: command.temperature,
            ..SamplingTask::default()
        },
        in_parts: true,
        ..PromptTask::default()
    })
}

impl WordsPack {
    /// Words of a text that captions of the pack's training have not used.
    fn unknown_words(&self, text: &str) -> Vec<String> {
        let Some(language) = self.loaded.pack.language() else {
            return Vec::new();
        };
        let unknown = language.unknown_words(text).into_iter();
        unknown
            .take(MAX_UNKNOWN_WORDS)
            .map(|word| word.chars().take(MAX_ECHO).collect())
            .collect()
    }

    /// Checks what the pack's model may be asked for.
    fn check(&self, path: &Path<'_>, command: &PerformCommand) -> Result<(), FieldError> {
        let pack = &self.loaded.pack;
        let Some(language) = pack.language() else {
            return Ok(());
        };
        // Any frames will do: how many there are is what counts.
        let key = KeyTensors {
            local_root: None,
            global_root: Some([0.0; GLOBAL_ROOT]),
            pose: Some(vec![0.0; pack.rig.dims.joints * POSE_NUMBERS].into()),
        };
        let past = vec![key; command.past_frames as usize];
        let checked = language.check(&task(command, past, 0));
        checked.map_err(|refusal| {
            let TaskRefusal {
                field,
                found,
                allowed,
            } = refusal;
            let field = match field {
                "frames" => "seconds",
                "temperature" => "temperature",
                _ => "text",
            };
            path.field(field).error(format!("is {found}"), allowed)
        })
    }
}

/// Numbers of a joint's pose.
const POSE_NUMBERS: usize = troupe_motion::features::FEATURES_PER_JOINT;
