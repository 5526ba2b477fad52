//! Opens glTF, binary or as text with its bytes beside it, and keeps of it what moves joints.

use std::borrow::Cow;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use gltf::json;
use gltf::json::validation::Checked;
use serde_json::{Map, Value};

use super::GlbReadError;

/// Length of a binary file's header, bytes.
const HEADER_BYTES: usize = 12;
/// Most bytes of a buffer inside a `data:` URI or in a file beside it.
pub(crate) const MAX_BUFFER_BYTES: usize = 1 << 30;
/// Extensions that compress the bytes of a buffer view.
const COMPRESSIONS: [&str; 2] = ["EXT_meshopt_compression", "KHR_meshopt_compression"];

/// Bytes of the files beside a `.gltf`, by the name that it gives; `None` if a file is not to be
/// had.
pub type Beside<'a> = &'a dyn Fn(&str) -> Option<Vec<u8>>;

/// A file with its buffers.
pub(super) struct Document<'a> {
    pub(super) gltf: gltf::Document,
    pub(super) buffers: Buffers<'a>,
    /// Channels without a node and of properties that move nothing.
    pub(super) ignored_channels: usize,
    /// Name and version of the program that wrote it, if it says so.
    pub(super) generator: Option<String>,
}

/// The bytes of each buffer, or the end of a sentence about why they are not to be had.
pub(super) struct Buffers<'a>(Vec<Result<Cow<'a, [u8]>, String>>);

impl Buffers<'_> {
    /// The bytes of a buffer.
    ///
    /// # Errors
    /// The end of a sentence about the keys in it.
    pub(super) fn bytes(&self, buffer: usize) -> Result<&[u8], String> {
        match self.0.get(buffer) {
            Some(Ok(bytes)) => Ok(bytes),
            Some(Err(why)) => Err(why.clone()),
            None => Err("its bytes are missing".to_owned()),
        }
    }
}

/// Opens a file of either form.
pub(super) fn open<'a>(bytes: &'a [u8], beside: Beside<'_>) -> Result<Document<'a>, GlbReadError> {
    let (text, blob) = match bytes.starts_with(b"glTF") {
        true => chunks(bytes)?,
        false => (Cow::Borrowed(bytes), None),
    };
    let text = text.strip_prefix(b"\xef\xbb\xbf").unwrap_or(&text);
    if !text.trim_ascii_start().starts_with(b"{") {
        return Err(wrong("it begins neither with \"glTF\" nor as JSON"));
    }
    let value: Value = json::deserialize::from_slice(text).map_err(|e| wrong(&e.to_string()))?;
    let (value, ignored_channels) = keep_motion(value)?;
    let root: json::Root = json::deserialize::from_value(value).map_err(|e| wrong(&e.to_string()))?;
    check_targets(&root)?;
    let generator = root.asset.generator.clone();
    let gltf = gltf::Document::from_json(root).map_err(|e| wrong(&e.to_string()))?;
    let buffers = gltf.buffers().map(|buffer| read_buffer(&buffer, &blob, beside));
    let buffers = Buffers(buffers.collect());
    Ok(Document {
        gltf,
        buffers,
        ignored_channels,
        generator,
    })
}

fn wrong(reason: &str) -> GlbReadError {
    GlbReadError::Format(reason.to_owned())
}

pub(super) type Chunks<'a> = (Cow<'a, [u8]>, Option<Cow<'a, [u8]>>);

/// The chunks of a binary file: JSON, and bytes if there are any.
pub(super) fn chunks(bytes: &[u8]) -> Result<Chunks<'_>, GlbReadError> {
    let length = bytes
        .get(8..HEADER_BYTES)
        .and_then(|length| length.try_into().ok());
    if length.is_none_or(|length| (u32::from_le_bytes(length) as usize) < HEADER_BYTES) {
        return Err(wrong("its header is cut, or gives an impossible length"));
    }
    let glb = gltf::Glb::from_slice(bytes).map_err(|e| wrong(&e.to_string()))?;
    Ok((glb.json, glb.bin))
}

fn read_buffer<'a>(
    buffer: &gltf::Buffer<'_>,
    blob: &Option<Cow<'a, [u8]>>,
    beside: Beside<'_>,
) -> Result<Cow<'a, [u8]>, String> {
    let uri = match buffer.source() {
        gltf::buffer::Source::Bin => {
            return blob.clone().ok_or_else(|| "its bytes are missing".to_owned());
        }
        gltf::buffer::Source::Uri(uri) => uri,
    };
    let bytes = match uri.strip_prefix("data:") {
        Some(data) => {
            let (kind, data) = data.split_once(',').unwrap_or_default();
            if !kind.ends_with(";base64") || data.len() / 4 * 3 > MAX_BUFFER_BYTES {
                return Err("its bytes are in a data: URI that is not base64, or too large".to_owned());
            }
            let bytes = STANDARD.decode(data);
            bytes.map_err(|e| format!("its bytes are in a data: URI that is not base64: {e}"))?
        }
        None => beside(&decoded(uri)).ok_or_else(|| {
            format!(
                "its bytes are in another file, {uri:?}, which is not to be had; it must be beside this one"
            )
        })?,
    };
    match bytes.len() <= MAX_BUFFER_BYTES {
        true => Ok(Cow::Owned(bytes)),
        false => Err(format!("buffer {uri:?} has more than {MAX_BUFFER_BYTES} bytes")),
    }
}

/// A URI with its `%20` and the like replaced.
fn decoded(uri: &str) -> String {
    let mut out = Vec::with_capacity(uri.len());
    let mut rest = uri.as_bytes();
    while let Some((&byte, after)) = rest.split_first() {
        let code = (byte == b'%').then(|| after.get(..2)).flatten();
        let code = code.and_then(|code| u8::from_str_radix(str::from_utf8(code).ok()?, 16).ok());
        out.push(code.unwrap_or(byte));
        rest = if code.is_some() { &after[2..] } else { after };
    }
    String::from_utf8_lossy(&out).into_owned()
}

/// Removes everything but nodes, skins and animations, so that nothing else can make a file
/// unreadable. Extensions change only the objects that they stand on; those that could change
/// motion are read or refused. Returns how many channels move no node.
fn keep_motion(mut value: Value) -> Result<(Value, usize), GlbReadError> {
    let Some(root) = value.as_object_mut() else {
        return Err(wrong("it is JSON, but no object"));
    };
    let parts = [
        "asset",
        "accessors",
        "animations",
        "buffers",
        "bufferViews",
        "nodes",
        "skins",
    ];
    root.retain(|key, _| parts.contains(&&**key));
    for_each(root.get_mut("nodes"), |node| {
        node.retain(|key, _| !["mesh", "camera", "skin", "weights", "extensions"].contains(&&**key));
    });
    for_each(root.get_mut("skins"), |skin| {
        skin.retain(|key, _| !["inverseBindMatrices", "extensions"].contains(&&**key));
    });
    let mut ignored = 0;
    for_each(root.get_mut("animations"), |animation| {
        if let Some(channels) = animation.get_mut("channels").and_then(Value::as_array_mut) {
            let before = channels.len();
            channels.retain_mut(keep_channel);
            ignored += before - channels.len();
        }
    });
    for compression in COMPRESSIONS {
        if is_compressed(root, compression) {
            return Err(wrong(&format!(
                "its keys are compressed by {compression}, which is not read; \
                 `gltf-transform copy` and `gltfpack -noq` write files without it"
            )));
        }
    }
    Ok((value, ignored))
}

type Object = Map<String, Value>;

/// Whether a channel moves a node. A `KHR_animation_pointer` to a node's property becomes a channel
/// of it.
fn keep_channel(channel: &mut Value) -> bool {
    let Some(target) = channel.get_mut("target").and_then(Value::as_object_mut) else {
        return true;
    };
    if target.get("path").and_then(Value::as_str) == Some("pointer") {
        let pointer = target
            .get("extensions")
            .and_then(|e| e.get("KHR_animation_pointer")?.get("pointer")?.as_str())
            .unwrap_or_default();
        let parts: Vec<&str> = pointer.split('/').collect();
        let ["", "nodes", node, path @ ("translation" | "rotation" | "scale")] = parts[..] else {
            return false;
        };
        let Ok(node) = node.parse::<u32>() else {
            return false;
        };
        let path = path.to_owned();
        target.clear();
        target.insert("node".to_owned(), node.into());
        target.insert("path".to_owned(), path.into());
    }
    target.contains_key("node")
}

/// Whether the keys of an animation are in a buffer view with an extension.
fn is_compressed(root: &Object, extension: &str) -> bool {
    let list = |name: &str| root.get(name).and_then(Value::as_array).map_or(&[][..], |l| l);
    let at = |list: &[Value], index: &Value| list.get(index.as_u64()? as usize).cloned();
    let samplers = list("animations").iter().flat_map(|animation| {
        let samplers = animation.get("samplers").and_then(Value::as_array);
        samplers.map_or(&[][..], |samplers| samplers).iter()
    });
    samplers
        .flat_map(|sampler| [sampler.get("input"), sampler.get("output")])
        .flatten()
        .filter_map(|accessor| at(list("accessors"), accessor))
        .filter_map(|accessor| at(list("bufferViews"), accessor.get("bufferView")?))
        .any(|view| view.get("extensions").is_some_and(|e| e.get(extension).is_some()))
}

fn for_each(list: Option<&mut Value>, mut change: impl FnMut(&mut Object)) {
    let list = list.and_then(Value::as_array_mut);
    for object in list.into_iter().flatten().filter_map(Value::as_object_mut) {
        change(object);
    }
}

/// Refuses targets that the library takes for granted. It checks everything else.
fn check_targets(root: &json::Root) -> Result<(), GlbReadError> {
    let mut channels = root.animations.iter().flat_map(|animation| &animation.channels);
    let is_wrong = |target: &json::animation::Target| {
        target.node.value() >= root.nodes.len() || matches!(target.path, Checked::Invalid)
    };
    match channels.any(|channel| is_wrong(&channel.target)) {
        false => Ok(()),
        true => Err(wrong(
            "a channel of an animation names no node, or no property of one",
        )),
    }
}
