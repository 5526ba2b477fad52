//! Keys of one animated property, and its value at any time.

use glam::{DQuat, DVec3, DVec4};
use gltf::accessor::{DataType, Dimensions};
use gltf::animation::Interpolation;
use gltf::animation::util::ReadOutputs;

use super::document::Buffers;
use crate::clip::MAX_FRAMES;

/// Tolerance of a key's time, seconds: times in files are rounded, and a step that is due must not
/// be missed.
const ROUNDING_S: f64 = 1e-5;

/// Most values of a sparse accessor: three a key, as cubic splines have.
const MAX_SPARSE_KEYS: usize = 3 * MAX_FRAMES;

/// Something that glTF interpolates.
pub(super) trait Value: Copy {
    /// Interpolates between two keys, linearly or on the sphere.
    fn between(self, other: Self, t: f64) -> Self;
    /// Weighted sum, for cubic splines.
    fn weigh(parts: [(Self, f64); 4]) -> Self;
    /// Makes a value usable: unit length for a rotation.
    fn tidy(self) -> Self;
}

impl Value for DVec3 {
    fn between(self, other: Self, t: f64) -> Self {
        self.lerp(other, t)
    }

    fn weigh(parts: [(Self, f64); 4]) -> Self {
        parts.iter().map(|&(value, weight)| value * weight).sum()
    }

    fn tidy(self) -> Self {
        self
    }
}

impl Value for DQuat {
    fn between(self, other: Self, t: f64) -> Self {
        // The short way round, as the format demands.
        self.slerp(other, t)
    }

    fn weigh(parts: [(Self, f64); 4]) -> Self {
        let sum: DVec4 = parts
            .iter()
            .map(|&(value, weight)| DVec4::from(value) * weight)
            .sum();
        Self::from_vec4(sum)
    }

    fn tidy(self) -> Self {
        match self.length() > 1e-6 {
            true => self.normalize(),
            false => Self::IDENTITY,
        }
    }
}

/// Keys over time, at least one.
#[derive(Clone, Debug)]
pub(super) struct Keys<T> {
    /// Seconds, increasing.
    times: Vec<f32>,
    /// One a key. For a cubic spline three: the tangent towards it, its value, and the tangent away
    /// from it.
    values: Vec<T>,
    interpolation: Interpolation,
}

impl<T: Value> Keys<T> {
    /// The value at a time. Before the first key and after the last, theirs. A key up to
    /// [`ROUNDING_S`] ahead counts as reached.
    pub(super) fn at(&self, time_s: f64) -> T {
        let next = self
            .times
            .partition_point(|&t| f64::from(t) <= time_s + ROUNDING_S);
        if next == 0 || next == self.times.len() {
            return self.value(next.saturating_sub(1)).tidy();
        }
        let (from, to) = (f64::from(self.times[next - 1]), f64::from(self.times[next]));
        let t = ((time_s - from) / (to - from)).max(0.0);
        match self.interpolation {
            Interpolation::Step => self.value(next - 1),
            Interpolation::Linear => self.value(next - 1).between(self.value(next), t),
            Interpolation::CubicSpline => {
                let (t2, t3, span) = (t * t, t * t * t, to - from);
                T::weigh([
                    (self.value(next - 1), 2.0 * t3 - 3.0 * t2 + 1.0),
                    (self.values[3 * next - 1], span * (t3 - 2.0 * t2 + t)),
                    (self.value(next), 3.0 * t2 - 2.0 * t3),
                    (self.values[3 * next], span * (t3 - t2)),
                ])
            }
        }
        .tidy()
    }

    /// The value of a key.
    fn value(&self, key: usize) -> T {
        match self.interpolation {
            Interpolation::CubicSpline => self.values[3 * key + 1],
            _ => self.values[key],
        }
    }

    /// The values of all keys.
    pub(super) fn all(&self) -> impl Iterator<Item = T> {
        (0..self.times.len()).map(|key| self.value(key))
    }

    /// Times of the keys, seconds.
    pub(super) fn times(&self) -> &[f32] {
        &self.times
    }
}

/// Keys of a property of a node that an animation may move.
pub(super) enum Track {
    Translation(Keys<DVec3>),
    Rotation(Keys<DQuat>),
    Scale(Keys<DVec3>),
    /// Weights of a mesh's shapes, which do not move joints.
    Other,
}

/// Reads the keys of a channel. The error is the end of a sentence about the channel.
pub(super) fn read_track(
    channel: &gltf::animation::Channel<'_>,
    buffers: &Buffers<'_>,
) -> Result<Track, String> {
    use gltf::animation::Property;

    let sampler = channel.sampler();
    let property = channel.target().property();
    let wanted = match property {
        Property::Translation | Property::Scale => Dimensions::Vec3,
        Property::Rotation => Dimensions::Vec4,
        Property::MorphTargetWeights => return Ok(Track::Other),
    };
    let (input, output) = (sampler.input(), sampler.output());
    let whole = |accessor: &gltf::Accessor<'_>| (accessor.data_type(), accessor.dimensions());
    if whole(&input) != (DataType::F32, Dimensions::Scalar) {
        return Err("times must be float scalars".to_owned());
    }
    let quantised = property == Property::Rotation && output.data_type() != DataType::U32;
    if output.dimensions() != wanted || !(output.data_type() == DataType::F32 || quantised) {
        return Err(format!(
            "{property:?} keys of {:?} {:?}",
            output.data_type(),
            output.dimensions()
        ));
    }
    check_extent(&input, buffers)?;
    check_extent(&output, buffers)?;
    let a_key = match sampler.interpolation() {
        Interpolation::CubicSpline => 3,
        _ => 1,
    };
    if input.count().checked_mul(a_key) != Some(output.count()) {
        return Err(format!(
            "{} values for {} keys of {a_key}",
            output.count(),
            input.count()
        ));
    }
    let reader = channel.reader(|buffer| buffers.bytes(buffer.index()).ok());
    let missing = || "its bytes are missing".to_owned();
    let times: Vec<f32> = reader.read_inputs().ok_or_else(missing)?.collect();
    if let Some(key) = times.iter().position(|t| !t.is_finite()) {
        return Err(format!("the time of key {key} is not finite"));
    }
    if let Some(before) = times.windows(2).position(|pair| pair[0] >= pair[1]) {
        return Err(format!("times do not rise at key {}", before + 1));
    }
    let interpolation = sampler.interpolation();
    let vectors = |values: gltf::accessor::Iter<'_, [f32; 3]>| {
        let values = values.map(|v| DVec3::from(v.map(f64::from))).collect();
        keys(times.clone(), values, interpolation, |v| v.is_finite())
    };
    match reader.read_outputs().ok_or_else(missing)? {
        ReadOutputs::Translations(values) => vectors(values).map(Track::Translation),
        ReadOutputs::Scales(values) => vectors(values).map(Track::Scale),
        ReadOutputs::Rotations(values) => {
            let values = values
                .into_f32()
                .map(|v| DQuat::from_array(v.map(f64::from)))
                .collect();
            keys(times.clone(), values, interpolation, |q| q.is_finite()).map(Track::Rotation)
        }
        ReadOutputs::MorphTargetWeights(_) => Ok(Track::Other),
    }
}

fn keys<T>(
    times: Vec<f32>,
    values: Vec<T>,
    interpolation: Interpolation,
    is_finite: impl Fn(&T) -> bool,
) -> Result<Keys<T>, String> {
    match values.iter().position(|value| !is_finite(value)) {
        Some(value) => Err(format!("value {value} is not finite")),
        None => Ok(Keys {
            times,
            values,
            interpolation,
        }),
    }
}

/// Checks that an accessor lies completely within the file's bytes, which the library takes for
/// granted.
fn check_extent(accessor: &gltf::Accessor<'_>, buffers: &Buffers<'_>) -> Result<(), String> {
    let last = accessor.count().checked_sub(1).ok_or("it has no keys")?;
    let size = accessor.size();
    if let Some(view) = accessor.view() {
        check_view(&view, accessor.offset(), last, size, buffers)?;
    }
    let Some(sparse) = accessor.sparse() else {
        return match accessor.view() {
            Some(_) => Ok(()),
            None => Err("its bytes are missing".to_owned()),
        };
    };
    // Without a view all values are zero, so that only the count limits the memory.
    if accessor.count() > MAX_SPARSE_KEYS {
        return Err(format!("more than {MAX_SPARSE_KEYS} sparse keys"));
    }
    let last = sparse.count().checked_sub(1).ok_or("it has no sparse keys")?;
    let (indices, values) = (sparse.indices(), sparse.values());
    check_view(
        &indices.view(),
        indices.offset(),
        last,
        indices.index_type().size(),
        buffers,
    )?;
    check_view(&values.view(), values.offset(), last, size, buffers)?;
    // The library takes them in this order, and would place keys elsewhere.
    let mut before = None;
    for at in 0..=last {
        let index = index_at(&indices, at, buffers)?;
        if index as usize >= accessor.count() || before.is_some_and(|before| before >= index) {
            return Err(format!(
                "index {at} of its sparse keys is {index}; they must rise, and be less than {}",
                accessor.count()
            ));
        }
        before = Some(index);
    }
    Ok(())
}

/// A sparse index. Its view must hold it ([`check_view`]).
fn index_at(
    indices: &gltf::accessor::sparse::Indices<'_>,
    at: usize,
    buffers: &Buffers<'_>,
) -> Result<u32, String> {
    let (view, size) = (indices.view(), indices.index_type().size());
    let start = view.offset() + indices.offset() + view.stride().unwrap_or(size) * at;
    let bytes = buffers.bytes(view.buffer().index())?;
    let bytes = bytes
        .get(start..start + size)
        .ok_or("its keys reach past the end of the bytes")?;
    Ok(bytes
        .iter()
        .rev()
        .fold(0, |index, &byte| index << 8 | u32::from(byte)))
}

/// Checks that a view holds items of `size` bytes from 0 to `last`.
fn check_view(
    view: &gltf::buffer::View<'_>,
    offset: usize,
    last: usize,
    size: usize,
    buffers: &Buffers<'_>,
) -> Result<(), String> {
    let bytes = buffers.bytes(view.buffer().index())?;
    let stride = view.stride().unwrap_or(size);
    let end = stride
        .checked_mul(last)
        .and_then(|n| n.checked_add(size))
        .and_then(|n| n.checked_add(offset));
    let view_end = view.offset().checked_add(view.length());
    let fits = stride >= size
        && end.is_some_and(|end| end <= view.length())
        && view_end.is_some_and(|end| end <= bytes.len());
    match fits {
        true => Ok(()),
        false => Err("its keys reach past the end of the bytes".to_owned()),
    }
}
