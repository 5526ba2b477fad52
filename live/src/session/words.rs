//! Sentences that characters act out: the packs that generate their motion, and the checks of the
//! commands.

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

/// Minimum and maximum length of a performance, seconds.
const SECONDS: (f32, f32) = (0.5, 30.0);
/// Maximum number of characters that perform at a time, over all tenants.
pub const MAX_PERFORMERS: usize = 512;
/// Estimated maximum memory of a performing character in addition to its session, bytes. It is for
/// the frames that wait.
pub const PERFORMER_BYTES: u64 = 384 << 10;
/// Maximum number of characters of an unknown word or a pack's name in an answer.
const MAX_ECHO: usize = 64;

/// A pack that generates motion from words, for the characters of another pack.
#[derive(Debug)]
pub struct WordsPack {
    /// The pack that generates the motion.
    pub loaded: Arc<LoadedPack>,
    /// Converts its motion to the skeleton of the characters.
    pub reader: PartReader,
}

/// Why a pack's characters cannot act out the motion of another pack.
#[derive(Debug, Clone)]
enum WhyNot {
    /// It does not generate motion from words.
    CannotDo(CannotDo),
    /// It has another skeleton or frame rate.
    Skeleton(OtherSkeleton),
    /// It needs this many past frames, which is too many.
    Past(usize),
}

/// Limits how many characters perform at a time. Clones share the limit.
#[derive(Debug, Clone)]
pub struct Places(Arc<Semaphore>);

impl Default for Places {
    fn default() -> Self {
        Self(Arc::new(Semaphore::new(MAX_PERFORMERS)))
    }
}

impl Places {
    /// Takes a place for one character. `None` if all are taken.
    pub fn take(&self) -> Option<OwnedSemaphorePermit> {
        self.0.clone().try_acquire_owned().ok()
    }
}

/// A running performance and its place. Dropping it stops the performance and frees the place.
#[derive(Debug)]
pub struct Performer {
    number: u64,
    _place: OwnedSemaphorePermit,
    _task: AbortOnDropHandle<()>,
}

impl Performer {
    /// The performance of the command `number`. `task` brings its frames.
    pub(super) fn new(number: u64, place: OwnedSemaphorePermit, task: JoinHandle<()>) -> Self {
        Self {
            number,
            _place: place,
            _task: AbortOnDropHandle::new(task),
        }
    }

    /// Number of the command that asked for the performance.
    pub fn number(&self) -> u64 {
        self.number
    }
}

/// All packs of a server, each with whether the characters of one pack can act out its motion.
#[derive(Debug, Default)]
pub struct WordsPacks {
    /// Limits how many characters perform at a time.
    pub places: Places,
    by_name: BTreeMap<String, Result<WordsPack, WhyNot>>,
    /// Name of the pack for commands that name none.
    default: Option<String>,
}

impl WordsPacks {
    /// Checks which packs of `table` fit the characters of `own`. Performances take places from
    /// `places`.
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

    /// The pack called `name`, if the characters can act out its motion.
    pub fn get(&self, name: &str) -> Option<&WordsPack> {
        self.by_name.get(name)?.as_ref().ok()
    }

    /// The pack called `name`, which the field at `path` has. An empty name means the default.
    fn find(&self, path: &Path<'_>, name: &str) -> Result<&WordsPack, SessionError> {
        let allowed = || {
            let fit = self.by_name.iter().filter(|(_, pack)| pack.is_ok());
            let names: Vec<&str> = fit.map(|(name, _)| name.as_str()).collect();
            match names.is_empty() {
                true => "none: no pack of this server turns words into motion for the session's skeleton"
                    .to_owned(),
                false => names.join(", "),
            }
        };
        let name = match (name, &self.default) {
            ("", None) => return Err(path.error("is empty, but there is no default", allowed()).into()),
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
                let message = format!("is {name:?}, which needs {frames} past frames");
                Err(path
                    .error(message, format!("packs that need at most {MAX_PAST_FRAMES}"))
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

    /// Checks a command and completes it with the pack's name and dimensions.
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

/// The generator's task for a command. Its motion continues the frames of `past`.
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
    /// Words of a text that do not occur in the captions of the pack's training data.
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

    /// Checks that the pack's model accepts the command.
    fn check(&self, path: &Path<'_>, command: &PerformCommand) -> Result<(), FieldError> {
        let pack = &self.loaded.pack;
        let Some(language) = pack.language() else {
            return Ok(());
        };
        // The check needs the number of past frames, but not their content.
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

/// Numbers per joint in a pose tensor.
const POSE_NUMBERS: usize = troupe_motion::features::FEATURES_PER_JOINT;
