//! NumPy's files: a clip as named arrays (`.npz`), and a robot's `qpos` as one array (`.npy`).

use std::io::{Cursor, Read as _, Write as _};

use glam::{Quat, Vec3};
use npyz::{
    AutoSerialize, DType, Deserialize, NpyFile, Serialize, TypeStr, WriteOptions, WriterBuilder as _,
};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipArchive, ZipWriter};

use crate::clip::{Clip, ClipError, MAX_ROTATIONS};
use crate::contacts;
use crate::fk::WorldMotion;
use crate::robot::{Fitted, Robot};
use crate::rotation::{align_sign, to_wxyz};
use crate::skeleton::Joint;

/// Largest array that is read, in bytes once unpacked.
const MAX_ARRAY_BYTES: u64 = 16 * MAX_ROTATIONS as u64 + 4096;

/// Why a NumPy file was not read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum NumpyError {
    /// The file is not a zip archive, or a broken one.
    #[error("no .npz archive: {0}")]
    Archive(String),
    /// An array cannot be used.
    #[error("array {name:?}: {reason}")]
    Array {
        /// Name of the array.
        name: String,
        /// What is wrong with it.
        reason: String,
    },
    /// The skeleton has no hinges.
    #[error("the skeleton is no robot's: it has no hinges that numbers could be angles of")]
    NoRobot,
    /// The frames do not make a clip.
    #[error(transparent)]
    Clip(#[from] ClipError),
}

impl NumpyError {
    pub(crate) fn array(name: &str, reason: impl std::fmt::Display) -> Self {
        Self::Array {
            name: name.to_owned(),
            reason: reason.to_string(),
        }
    }
}

/// Writes a clip as an `.npz` archive with these arrays:
///
/// | array | shape | type | holds |
/// |---|---|---|---|
/// | `positions` | frames, joints, 3 | float32 | places in the world, metres |
/// | `quaternions` | frames, joints, 4 | float32 | rotations w x y z: joint 0 in the world, others relative to their parents |
/// | `root` | frames, 3 | float32 | place of joint 0, metres |
/// | `fps` | | float32 | frames a second |
/// | `joint_names` | joints | text | |
/// | `parents` | joints | int32 | -1 for joint 0 |
/// | `offsets` | joints, 3 | float32 | offset from the parent in its frame, metres |
/// | `contacts` | frames, contact joints | bool | whether they touch the ground; only if the skeleton has contact joints |
/// | `contact_joints` | contact joints | text | which joints those are |
/// | `qpos` | frames, 7 + hinges | float32 | MuJoCo's numbers; only for robots |
///
/// The same clip gives the same bytes.
///
/// # Errors
/// [`NumpyError`] if memory or the format's sizes do not suffice.
pub fn write_npz(clip: &Clip) -> Result<Vec<u8>, NumpyError> {
    let skeleton = &*clip.skeleton;
    let (frames, joints) = (clip.frames(), skeleton.joint_count());
    let world = WorldMotion::from_clip(clip);
    let mut archive = Archive::new();
    let floats = |vectors: &[Vec3]| -> Vec<f32> { vectors.iter().flat_map(|v| v.to_array()).collect() };
    archive.add("positions", &[frames, joints, 3], &floats(&world.positions))?;
    archive.add("quaternions", &[frames, joints, 4], &quaternions(clip))?;
    archive.add("root", &[frames, 3], &floats(&clip.root_positions))?;
    archive.add("fps", &[], &[clip.fps])?;
    let names: Vec<&str> = skeleton.joints.iter().map(|joint| &*joint.name).collect();
    archive.add_names("joint_names", &names)?;
    let parent = |joint: &Joint| joint.parent.map_or(-1, |parent| parent as i32);
    let parents: Vec<i32> = skeleton.joints.iter().map(parent).collect();
    archive.add("parents", &[joints], &parents)?;
    let offsets: Vec<Vec3> = skeleton.joints.iter().map(|joint| joint.offset_m).collect();
    archive.add("offsets", &[joints, 3], &floats(&offsets))?;
    if let Some(params) = &skeleton.contacts {
        let touch = contacts::detect(&world, params, skeleton.ground_y_m, clip.fps);
        archive.add("contacts", &[frames, params.len()], &touch)?;
        let which: Vec<&str> = params.joints.iter().map(|&joint| names[joint]).collect();
        archive.add_names("contact_joints", &which)?;
    }
    if let Some(robot) = &skeleton.robot {
        archive.add("qpos", &[frames, robot.qpos_len()], &qpos(clip, robot))?;
    }
    archive.finish()
}

/// Rotations of all frames, w x y z, without a change of sign between frames.
fn quaternions(clip: &Clip) -> Vec<f32> {
    let joints = clip.skeleton.joint_count();
    let mut out = Vec::with_capacity(4 * clip.rotations.len());
    let mut before = vec![Quat::IDENTITY; joints];
    for pose in clip.rotations.chunks_exact(joints) {
        for (&rotation, before) in pose.iter().zip(&mut before) {
            *before = align_sign(rotation, *before);
            out.extend(to_wxyz(*before));
        }
    }
    out
}

/// MuJoCo's numbers of all frames, on the hinges and within their limits.
fn qpos(clip: &Clip, robot: &Robot) -> Vec<f32> {
    let size = robot.qpos_len();
    let mut out = vec![0.0; clip.frames() * size];
    let mut pose = vec![Quat::IDENTITY; clip.skeleton.joint_count()];
    let mut fitted = Fitted::default();
    let mut before = Quat::IDENTITY;
    for (frame, row) in out.chunks_exact_mut(size).enumerate() {
        pose.copy_from_slice(clip.rotations_at(frame));
        robot.fit(&mut pose, &mut fitted);
        before = align_sign(pose[0], before);
        robot.write_qpos(clip.root_positions[frame], before, &fitted.angles, row);
    }
    out
}

/// A robot's clip as an `.npy` array: frames of MuJoCo's `qpos`, float32.
///
/// # Errors
/// [`NumpyError::NoRobot`].
pub fn write_qpos(clip: &Clip) -> Result<Vec<u8>, NumpyError> {
    let robot = clip.skeleton.robot.as_ref().ok_or(NumpyError::NoRobot)?;
    let mut bytes = Vec::new();
    let shape = [clip.frames(), robot.qpos_len()];
    write_array(&mut bytes, &shape, &qpos(clip, robot)).map_err(|e| NumpyError::array("qpos", e))?;
    Ok(bytes)
}

/// Number of rows of an array whose other sizes are `rest`.
fn rows_of(name: &str, shape: &[u64], rest: &[usize]) -> Result<usize, NumpyError> {
    match shape {
        [rows, others @ ..] if others.iter().copied().eq(rest.iter().map(|&n| n as u64)) => {
            Ok(*rows as usize)
        }
        _ => {
            let rest: Vec<String> = rest.iter().map(usize::to_string).collect();
            let wanted = rest.join(", ");
            Err(NumpyError::array(
                name,
                format_args!("shape {shape:?}; it must be frames, {wanted}"),
            ))
        }
    }
}

/// A growing archive. Nothing is compressed, and no time is stored.
pub(crate) struct Archive(ZipWriter<Cursor<Vec<u8>>>);

impl Archive {
    pub(crate) fn new() -> Self {
        Self(ZipWriter::new(Cursor::new(Vec::new())))
    }

    /// The bytes of the archive.
    pub(crate) fn finish(self) -> Result<Vec<u8>, NumpyError> {
        let whole = self.0.finish().map_err(|e| NumpyError::Archive(e.to_string()))?;
        Ok(whole.into_inner())
    }

    pub(crate) fn add<T: AutoSerialize + Serialize>(
        &mut self,
        name: &str,
        shape: &[usize],
        values: &[T],
    ) -> Result<(), NumpyError> {
        let mut bytes = Vec::new();
        write_array(&mut bytes, shape, values).map_err(|e| NumpyError::array(name, e))?;
        self.store(name, &bytes)
    }

    pub(crate) fn add_names(&mut self, name: &str, names: &[&str]) -> Result<(), NumpyError> {
        let longest = names.iter().map(|name| name.chars().count()).max().unwrap_or(1);
        let text = format!("<U{longest}").parse::<TypeStr>();
        let text = text.map_err(|e| NumpyError::array(name, e))?;
        let mut bytes = Vec::new();
        let write = || {
            let mut writer = WriteOptions::<str>::new()
                .dtype(DType::new_scalar(text))
                .shape(&[names.len() as u64])
                .writer(&mut bytes)
                .begin_nd()?;
            for name in names {
                writer.push(name)?;
            }
            writer.finish()
        };
        write().map_err(|e| NumpyError::array(name, e))?;
        self.store(name, &bytes)
    }

    fn store(&mut self, name: &str, bytes: &[u8]) -> Result<(), NumpyError> {
        let options = SimpleFileOptions::default()
            .compression_method(CompressionMethod::Stored)
            .last_modified_time(DateTime::DEFAULT)
            .large_file(bytes.len() > 0x7fff_ffff);
        let stored = (self.0.start_file(format!("{name}.npy"), options)).map_err(std::io::Error::from);
        let stored = stored.and_then(|()| self.0.write_all(bytes));
        stored.map_err(|e| NumpyError::array(name, e))
    }
}

pub(crate) fn write_array<T: AutoSerialize + Serialize>(
    out: &mut Vec<u8>,
    shape: &[usize],
    values: &[T],
) -> std::io::Result<()> {
    let shape: Vec<u64> = shape.iter().map(|&n| n as u64).collect();
    let mut writer = WriteOptions::new()
        .default_dtype()
        .shape(&shape)
        .writer(out)
        .begin_nd()?;
    writer.extend(values)?;
    writer.finish()
}

/// An archive that is being read.
pub(crate) struct Unpacked<'a>(ZipArchive<Cursor<&'a [u8]>>);

impl<'a> Unpacked<'a> {
    pub(crate) fn open(bytes: &'a [u8]) -> Result<Self, NumpyError> {
        let archive = ZipArchive::new(Cursor::new(bytes));
        // The library's own words name parts of the format.
        let reason = match bytes.starts_with(b"PK") {
            true => "the zip archive is damaged or cut off",
            false => "it does not begin as a zip archive does",
        };
        Ok(Self(archive.map_err(|_| NumpyError::Archive(reason.to_owned()))?))
    }

    /// Names of its arrays.
    pub(crate) fn names(&self) -> Vec<String> {
        let names = self.0.file_names();
        names
            .flatten()
            .map(|name| name.trim_end_matches(".npy").to_owned())
            .collect()
    }

    pub(crate) fn has(&self, name: &str) -> bool {
        self.0.index_for_name(&format!("{name}.npy")).is_some()
    }

    /// Shape and numbers of an array.
    pub(crate) fn floats(&mut self, name: &str) -> Result<(Vec<u64>, Vec<f32>), NumpyError> {
        let bytes = unpack(&mut self.0, name)?;
        read_array(&bytes).map_err(|reason| NumpyError::array(name, reason))
    }

    /// The numbers of an array of frames, whose other sizes are `rest`.
    pub(crate) fn rows(&mut self, name: &str, rest: &[usize]) -> Result<(usize, Vec<f32>), NumpyError> {
        let (shape, numbers) = self.floats(name)?;
        let rows = rows_of(name, &shape, rest)?;
        match numbers.iter().position(|n| !n.is_finite()) {
            None => Ok((rows, numbers)),
            Some(at) => {
                let row = at / rest.iter().product::<usize>().max(1);
                Err(NumpyError::array(name, format_args!("row {row} is not finite")))
            }
        }
    }

    pub(crate) fn texts(&mut self, name: &str) -> Result<Vec<String>, NumpyError> {
        let bytes = unpack(&mut self.0, name)?;
        read_names(&bytes).map_err(|reason| NumpyError::array(name, reason))
    }
}

/// The bytes of one array of an archive.
fn unpack(archive: &mut ZipArchive<Cursor<&[u8]>>, name: &str) -> Result<Vec<u8>, NumpyError> {
    let entry = archive.by_name(&format!("{name}.npy"));
    let entry = entry.map_err(|e| NumpyError::array(name, e))?;
    let mut bytes = Vec::new();
    // Limits what comes out, instead of trusting the archive's own size.
    let read = entry.take(MAX_ARRAY_BYTES + 1).read_to_end(&mut bytes);
    match read.map_err(|e| NumpyError::array(name, e))? as u64 {
        size if size > MAX_ARRAY_BYTES => Err(NumpyError::array(name, "it is too large")),
        _ => Ok(bytes),
    }
}

/// Shape and numbers of an array of floats of any size, as float32.
pub(crate) fn read_array(bytes: &[u8]) -> Result<(Vec<u64>, Vec<f32>), String> {
    let file = open(bytes)?;
    let shape = file.shape().to_vec();
    let is_turned = file.order() == npyz::Order::Fortran;
    let numbers = numbers_of::<f32>(file, |n| n)
        .or_else(|file| numbers_of::<f64>(file, |n| n as f32))
        .or_else(|file| numbers_of::<i64>(file, |n| n as f32))
        .or_else(|file| numbers_of::<i32>(file, |n| n as f32));
    let numbers = numbers.map_err(|file| {
        let kind = file.dtype().descr();
        format!("its type is {kind}; it must be float32 or float64")
    })?;
    let numbers = numbers.map_err(|e| e.to_string())?;
    let numbers = match is_turned {
        true => in_rows(&numbers, &shape),
        false => numbers,
    };
    Ok((shape, numbers))
}

/// The numbers of an array in Fortran's order, whose first index runs fastest, in C's.
fn in_rows(numbers: &[f32], shape: &[u64]) -> Vec<f32> {
    let mut at = vec![0; shape.len()];
    let mut out = Vec::with_capacity(numbers.len());
    for _ in 0..numbers.len() {
        let place = shape.iter().zip(&at).rev();
        let place = place.fold(0, |place, (&size, &at)| place * size as usize + at);
        out.extend(numbers.get(place));
        for (at, &size) in at.iter_mut().zip(shape).rev() {
            *at += 1;
            if *at < size as usize {
                break;
            }
            *at = 0;
        }
    }
    out
}

/// The numbers of an array of one type; the file itself if it is of another.
fn numbers_of<T: Deserialize>(
    file: NpyFile<&[u8]>,
    number: impl Fn(T) -> f32,
) -> Result<std::io::Result<Vec<f32>>, NpyFile<&[u8]>> {
    let numbers = file.try_data::<T>()?;
    Ok(numbers.map(|n| n.map(&number)).collect())
}

fn read_names(bytes: &[u8]) -> Result<Vec<String>, String> {
    collect(open(bytes)?.data::<String>().map_err(|e| e.to_string())?)
}

fn collect<T: Deserialize>(values: npyz::NpyReader<T, &[u8]>) -> Result<Vec<T>, String> {
    values.collect::<Result<_, _>>().map_err(|e| e.to_string())
}

/// Opens an array that holds all of its numbers, so that no size is taken from the header alone.
fn open(bytes: &[u8]) -> Result<NpyFile<&[u8]>, String> {
    let file = NpyFile::new(bytes).map_err(|e| e.to_string())?;
    let count = file.shape().iter().try_fold(1_u64, |all, &n| all.checked_mul(n));
    match count.is_some_and(|count| count <= bytes.len() as u64) {
        true => Ok(file),
        false => Err(format!("shape {:?} is more than the file holds", file.shape())),
    }
}
