//! Frames of many characters as columns of numbers.

use troupe_motion::codec::{BYTES_PER_ROOT, BYTES_PER_ROTATION, encode_root, encode_rotation};
use troupe_motion::conventions::Convention;
use troupe_motion::fk::world_transforms;
use troupe_motion::rotation::{six_d, to_wxyz};
use troupe_motion::{Quat, Robot, Skeleton, Vec3};
use troupe_proto::v1;

use super::LivePack;
use troupe_character::live::FrameOut;
use troupe_character::{FieldError, Path};
use troupe_motion::model::SIX_D;

/// The form in which frames are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Form {
    /// The encoding of roots and rotations.
    pub encoding: v1::Encoding,
    /// Whether world joint positions are written too.
    pub positions: bool,
    /// Whether world rotations in 6D form are written too.
    pub six_d: bool,
}

impl Form {
    /// Reads the form from the fields `encoding`, `return_positions` and `return_six_d` of the
    /// message at `path`.
    ///
    /// # Errors
    /// [`FieldError`] for an unknown encoding.
    pub fn of(path: &Path<'_>, encoding: i32, positions: bool, six_d: bool) -> Result<Self, FieldError> {
        let encoding = v1::Encoding::try_from(encoding).map_err(|_| {
            path.field("encoding").error(
                format!("is {encoding}"),
                "ENCODING_F32 (0) or ENCODING_COMPACT (1), or ENCODING_QPOS (2) of robots",
            )
        })?;
        Ok(Self {
            encoding,
            positions,
            six_d,
        })
    }

    /// Checks that frames of `pack` can be written in this form. `path` is the message that has the
    /// form.
    ///
    /// # Errors
    /// [`FieldError`] for `qpos` without a robot.
    pub fn check(&self, path: &Path<'_>, pack: &LivePack) -> Result<(), FieldError> {
        if self.encoding != v1::Encoding::Qpos || pack.shown().robot.is_some() {
            return Ok(());
        }
        let what = match pack.worn() {
            Some(worn) => format!("skeleton {}", worn.name()),
            None => format!("pack {}", pack.rig().name()),
        };
        Err(path.field("encoding").error(
            format!("is qpos, but {what} has no robot"),
            "f32 or compact; qpos for packs with a robot",
        ))
    }
}

/// Writes the columns of one block. They are allocated once; frames can be written in any order.
#[derive(Debug)]
pub struct BlockWriter {
    form: Form,
    joints: usize,
    frames: usize,
    /// Numbers of a robot's `qpos`. 0 without a robot.
    qpos_len: usize,
    block: v1::FrameBlock,
    /// Scratch for the world positions and rotations of one pose.
    world: (Vec<Vec3>, Vec<Quat>),
}

impl BlockWriter {
    /// Makes a block for `characters` on `skeleton`, with `frames` frames each.
    pub fn new(skeleton: &Skeleton, form: Form, characters: usize, frames: usize) -> Self {
        let joints = skeleton.joint_count();
        let cells = characters * frames;
        let (floats, bytes, angles) = match form.encoding {
            v1::Encoding::F32 => (cells, 0, 0),
            v1::Encoding::Compact => (0, cells, 0),
            v1::Encoding::Qpos => (0, 0, cells),
        };
        let qpos_len = skeleton.robot.as_ref().map_or(0, Robot::qpos_len);
        let posed = if form.positions || form.six_d { joints } else { 0 };
        let placed = if form.positions { cells * joints } else { 0 };
        let turned = if form.six_d { cells * joints } else { 0 };
        let block = v1::FrameBlock {
            pack: String::new(),
            body: String::new(),
            skeleton: String::new(),
            slots: Vec::with_capacity(characters),
            frame_count: frames as u32,
            first_frames: vec![0; characters],
            root_positions: vec![0.0; floats * 3],
            rotations: vec![0.0; floats * joints * 4],
            packed_roots: vec![0; bytes * BYTES_PER_ROOT],
            packed_rotations: vec![0; bytes * joints * BYTES_PER_ROTATION],
            contacts: vec![0; cells],
            positions: vec![0.0; placed * 3],
            six_d: vec![0.0; turned * SIX_D],
            qpos: vec![0.0; angles * qpos_len],
            hinge_residuals: vec![0.0; angles],
            clamped_hinges: vec![0; angles],
            hinge_speed_ratios: vec![0.0; angles],
            fastest_hinges: vec![0; angles],
            hinge_accelerations: vec![0.0; angles],
        };
        Self {
            form,
            joints,
            frames,
            qpos_len,
            block,
            world: (vec![Vec3::ZERO; posed], vec![Quat::IDENTITY; posed]),
        }
    }

    /// Makes a block as [`BlockWriter::new`] does, with the names of pack, body and skeleton.
    pub fn of(pack: &LivePack, form: Form, characters: usize, frames: usize) -> Self {
        let mut writer = Self::new(pack.shown(), form, characters, frames);
        writer.block.pack = pack.name().to_owned();
        writer.block.body = pack.body_name().to_owned();
        writer.block.skeleton = pack
            .worn()
            .map(|worn| worn.name().to_string())
            .unwrap_or_default();
        writer
    }

    /// Sets the slot of the next character. Call it once per character, in order.
    pub fn name(&mut self, slot: u32) {
        self.block.slots.push(slot);
    }

    /// Writes frame number `frame` of character number `character`. Both count from 0.
    pub fn write(
        &mut self,
        (character, frame): (usize, usize),
        out: &FrameOut,
        convention: Convention,
        skeleton: &Skeleton,
    ) {
        let cell = character * self.frames + frame;
        if frame == 0 {
            self.block.first_frames[character] = out.frame;
        }
        self.block.contacts[cell] = out.contacts;
        match self.form.encoding {
            v1::Encoding::F32 => self.write_floats(cell, out, convention),
            v1::Encoding::Compact => self.write_compact(cell, out, convention),
            v1::Encoding::Qpos => self.write_qpos(cell, out, skeleton),
        }
        if self.form.positions || self.form.six_d {
            self.write_world(cell, out, convention, skeleton);
        }
    }

    fn write_floats(&mut self, cell: usize, out: &FrameOut, convention: Convention) {
        let root = convention.position_from_native(out.root).to_array();
        self.block.root_positions[cell * 3..cell * 3 + 3].copy_from_slice(&root);
        let row = &mut self.block.rotations[cell * self.joints * 4..(cell + 1) * self.joints * 4];
        for (wxyz, &rotation) in row.as_chunks_mut::<4>().0.iter_mut().zip(&out.rotations) {
            *wxyz = to_wxyz(convention.rotation_from_native(rotation));
        }
    }

    fn write_compact(&mut self, cell: usize, out: &FrameOut, convention: Convention) {
        // Compact roots are in 0.1 mm for every convention.
        let steps = encode_root(convention.direction_from_native(out.root));
        let row = &mut self.block.packed_roots[cell * BYTES_PER_ROOT..(cell + 1) * BYTES_PER_ROOT];
        for (bytes, step) in row.as_chunks_mut::<4>().0.iter_mut().zip(steps) {
            *bytes = step.to_le_bytes();
        }
        let size = self.joints * BYTES_PER_ROTATION;
        let row = &mut self.block.packed_rotations[cell * size..(cell + 1) * size];
        let places = row.as_chunks_mut::<BYTES_PER_ROTATION>().0;
        for (place, &rotation) in places.iter_mut().zip(&out.rotations) {
            let words = encode_rotation(convention.rotation_from_native(rotation));
            for (bytes, word) in place.as_chunks_mut::<2>().0.iter_mut().zip(words) {
                *bytes = word.to_le_bytes();
            }
        }
    }

    /// Writes `qpos` in MuJoCo's axes, which do not depend on the convention.
    fn write_qpos(&mut self, cell: usize, out: &FrameOut, skeleton: &Skeleton) {
        // `Form::check` has refused packs without a robot.
        let (Some(robot), Some(&pelvis)) = (&skeleton.robot, out.rotations.first()) else {
            return;
        };
        let row = &mut self.block.qpos[cell * self.qpos_len..(cell + 1) * self.qpos_len];
        robot.write_qpos(out.root, pelvis, &out.fitted.angles, row);
        self.block.hinge_residuals[cell] = out.fitted.residual_rad;
        self.block.clamped_hinges[cell] = out.fitted.clamped as u32;
        self.block.hinge_speed_ratios[cell] = out.hinge_rate.speed_ratio;
        self.block.fastest_hinges[cell] = out.hinge_rate.fastest as u32;
        self.block.hinge_accelerations[cell] = out.hinge_rate.acceleration_rad_per_s2;
    }

    fn write_world(&mut self, cell: usize, out: &FrameOut, convention: Convention, skeleton: &Skeleton) {
        let (positions, rotations) = &mut self.world;
        world_transforms(skeleton, out.root, &out.rotations, positions, rotations);
        let row = cell * self.joints..(cell + 1) * self.joints;
        if self.form.positions {
            let row = &mut self.block.positions[row.start * 3..row.end * 3];
            for (place, &position) in row.as_chunks_mut::<3>().0.iter_mut().zip(positions.iter()) {
                *place = convention.position_from_native(position).to_array();
            }
        }
        if self.form.six_d {
            let row = &mut self.block.six_d[row.start * SIX_D..row.end * SIX_D];
            for (place, &rotation) in row.as_chunks_mut::<SIX_D>().0.iter_mut().zip(rotations.iter()) {
                *place = six_d(convention.rotation_from_native(rotation));
            }
        }
    }

    /// Returns the block with those characters for which `keep` is true.
    pub fn finish(mut self, keep: impl Fn(usize) -> bool) -> v1::FrameBlock {
        let characters = self.block.slots.len();
        if (0..characters).all(&keep) {
            return self.block;
        }
        let block = &mut self.block;
        retain_rows(&mut block.slots, characters, &keep);
        retain_rows(&mut block.first_frames, characters, &keep);
        retain_rows(&mut block.root_positions, characters, &keep);
        retain_rows(&mut block.rotations, characters, &keep);
        retain_rows(&mut block.packed_roots, characters, &keep);
        retain_rows(&mut block.packed_rotations, characters, &keep);
        retain_rows(&mut block.contacts, characters, &keep);
        retain_rows(&mut block.positions, characters, &keep);
        retain_rows(&mut block.six_d, characters, &keep);
        retain_rows(&mut block.qpos, characters, &keep);
        retain_rows(&mut block.hinge_residuals, characters, &keep);
        retain_rows(&mut block.clamped_hinges, characters, &keep);
        retain_rows(&mut block.hinge_speed_ratios, characters, &keep);
        retain_rows(&mut block.fastest_hinges, characters, &keep);
        retain_rows(&mut block.hinge_accelerations, characters, &keep);
        self.block
    }
}

/// Keeps those rows of a column for which `keep` is true.
fn retain_rows<T: Copy>(column: &mut Vec<T>, rows: usize, keep: impl Fn(usize) -> bool) {
    let size = column.len() / rows.max(1);
    let mut kept = 0;
    for row in (0..rows).filter(|&row| keep(row)) {
        column.copy_within(row * size..(row + 1) * size, kept * size);
        kept += 1;
    }
    column.truncate(kept * size);
}

#[cfg(test)]
#[path = "encode_tests.rs"]
mod tests;
