//! Frames of a crowd as columns, in buffers that are filled again and again.

use std::ptr;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use glam::{Quat, Vec3};
use troupe_client::{Frame, Frames};
use troupe_motion::rotation::six_d;

use crate::sized::Versioned;
use crate::status::TroupeStatus;

/// The newest frames of a crowd, in place: nothing is copied. The columns hold until the next
/// `troupe_crowd_read`, `troupe_crowd_step` or `troupe_crowd_close` of this crowd. Do not write to
/// them.
///
/// With C characters, F frames each and J joints, every column has all frames of character 0, then
/// all of character 1, and so on.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct TroupeFrames {
    /// `sizeof(TroupeFrames)`.
    pub size: u32,
    /// C: characters of the crowd, those without frames too.
    pub character_count: u32,
    /// F: frames of each character. 1 on the server's clock; as many as the step asked for on the
    /// caller's.
    pub frame_count: u32,
    /// J: joints of the pack.
    pub joint_count: u32,
    /// Numbers of a rotation: 4 for quaternions, 6 for the 6D form.
    pub rotation_size: u32,
    /// Frames a second.
    pub rate_hz: u32,
    /// Number of the tick or step, from 0.
    pub tick: u64,
    /// Ticks so far that this caller did not get, because newer ones had come.
    pub missed_ticks: u64,
    /// C: 1 for a character with frames here; 0 for one without, whose rows mean nothing.
    pub present: *const u8,
    /// C: number of each character's first frame on its own timeline, which has 30 frames a second.
    pub first_frames: *const u64,
    /// C x F x 3: position of the first joint in the world, metres.
    pub root_positions: *const f32,
    /// C x F x J x `rotation_size`: of the first joint in the world, of the others relative to
    /// their parents. Quaternions are x, y, z, w, have unit length, and begin at multiples of 16
    /// bytes. The 6D form is the first two columns of the matrix: x, y, z of the first, then of the
    /// second.
    pub rotations: *const f32,
    /// C x F: bit n is set while contact joint n of the pack is on the ground.
    pub contacts: *const u8,
    /// C x F x J x 3: positions of the joints in the world, metres. Null, unless the options ask
    /// for them.
    pub joint_positions: *const f32,
}

impl Versioned for TroupeFrames {
    const NAME: &'static str = "TroupeFrames";
}

/// Form of frames.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Form {
    pub(crate) joints: usize,
    pub(crate) rate_hz: u32,
    pub(crate) as_six_d: bool,
    pub(crate) positions: bool,
}

/// A tick of all characters.
#[derive(Debug, Clone)]
pub(crate) struct Columns {
    form: Form,
    frames: usize,
    pub(crate) tick: u64,
    pub(crate) missed: u64,
    present: Vec<u8>,
    first_frames: Vec<u64>,
    roots: Vec<Vec3>,
    /// Rotations as quaternions, or none.
    quaternions: Vec<Quat>,
    /// Rotations in the 6D form, or none.
    six_d: Vec<[f32; 6]>,
    contacts: Vec<u8>,
    positions: Vec<Vec3>,
}

impl Columns {
    /// Columns with room for one frame of each character.
    pub(crate) fn new(characters: usize, form: Form) -> Self {
        let mut columns = Self {
            form,
            frames: 0,
            tick: 0,
            missed: 0,
            present: vec![0; characters],
            first_frames: vec![0; characters],
            roots: Vec::new(),
            quaternions: Vec::new(),
            six_d: Vec::new(),
            contacts: Vec::new(),
            positions: Vec::new(),
        };
        columns.begin(1);
        columns
    }

    /// Makes room for this many frames of each character, and forgets those that it has. It
    /// allocates only for more frames than ever before.
    pub(crate) fn begin(&mut self, frames: usize) {
        self.present.fill(0);
        if frames == self.frames {
            return;
        }
        self.frames = frames;
        let all = self.present.len() * frames;
        let of_joints = all * self.form.joints;
        self.roots.resize(all, Vec3::ZERO);
        self.contacts.resize(all, 0);
        match self.form.as_six_d {
            true => self.six_d.resize(of_joints, [0.0; 6]),
            false => self.quaternions.resize(of_joints, Quat::IDENTITY),
        }
        if self.form.positions {
            self.positions.resize(of_joints, Vec3::ZERO);
        }
    }

    /// Puts the frames of a character in. Frames of another number or skeleton are left out.
    pub(crate) fn put(&mut self, character: usize, frames: Frames<'_>) {
        let joints = self.form.joints;
        let fits = frames.len() == self.frames && character < self.present.len();
        if !fits || frames.iter().any(|frame| frame.rotations.len() != joints) {
            return;
        }
        self.present[character] = 1;
        self.first_frames[character] = frames.first_frame();
        for (nth, frame) in frames.iter().enumerate() {
            self.row(character * self.frames + nth, frame);
        }
    }

    /// Puts one frame in.
    fn row(&mut self, row: usize, frame: Frame<'_>) {
        let joints = self.form.joints;
        let of_joints = row * joints..(row + 1) * joints;
        self.roots[row] = frame.root;
        self.contacts[row] = frame.contacts.bits();
        if self.form.as_six_d {
            let each = self.six_d[of_joints.clone()].iter_mut();
            each.zip(frame.rotations)
                .for_each(|(to, &from)| *to = six_d(from));
        } else {
            self.quaternions[of_joints.clone()].copy_from_slice(frame.rotations);
        }
        if self.form.positions && frame.positions.len() == joints {
            self.positions[of_joints].copy_from_slice(frame.positions);
        }
    }

    /// Last place of a character, if it has frames here.
    pub(crate) fn place(&self, character: usize) -> Option<Vec3> {
        let present = *self.present.get(character)? == 1;
        let last = (character * self.frames + self.frames).checked_sub(1)?;
        self.roots.get(last).copied().filter(|_| present)
    }

    /// The columns for C.
    pub(crate) fn view(&self) -> TroupeFrames {
        let rotations = match self.form.as_six_d {
            true => self.six_d.as_ptr().cast::<f32>(),
            false => self.quaternions.as_ptr().cast::<f32>(),
        };
        let positions = match self.form.positions {
            true => self.positions.as_ptr().cast::<f32>(),
            false => ptr::null(),
        };
        let number = |of: usize| u32::try_from(of).unwrap_or(u32::MAX);
        TroupeFrames {
            size: 0,
            character_count: number(self.present.len()),
            frame_count: number(self.frames),
            joint_count: number(self.form.joints),
            rotation_size: if self.form.as_six_d { 6 } else { 4 },
            rate_hz: self.form.rate_hz,
            tick: self.tick,
            missed_ticks: self.missed,
            present: self.present.as_ptr(),
            first_frames: self.first_frames.as_ptr(),
            root_positions: self.roots.as_ptr().cast(),
            rotations,
            contacts: self.contacts.as_ptr(),
            joint_positions: positions,
        }
    }
}

/// Between the stream, which writes ticks, and the reader. Each has columns of its own, and a third
/// set waits here: so neither waits while the other copies, and the newest tick wins.
#[derive(Debug)]
pub(crate) struct Exchange {
    waiting: Mutex<Waiting>,
    came: Condvar,
}

#[derive(Debug)]
struct Waiting {
    columns: Columns,
    fresh: bool,
    /// Ticks that a newer one replaced before they were read.
    replaced: u64,
    /// Last place of each character.
    places: Vec<Vec3>,
    /// Why no further tick will come.
    end: Option<(TroupeStatus, String)>,
}

/// What a reader finds.
#[derive(Debug, PartialEq)]
pub(crate) enum Found {
    /// A newer tick, which is in the reader's columns now.
    Newer,
    /// Nothing new.
    Nothing,
    /// Nothing, for ever.
    Ended(TroupeStatus, String),
}

impl Waiting {
    fn learn(&mut self, columns: &Columns) {
        for (character, place) in self.places.iter_mut().enumerate() {
            *place = columns.place(character).unwrap_or(*place);
        }
    }
}

impl Exchange {
    /// Without a tick. `places` are where the characters begin.
    pub(crate) fn new(columns: Columns, places: Vec<Vec3>) -> Self {
        Self {
            waiting: Mutex::new(Waiting {
                columns,
                fresh: false,
                replaced: 0,
                places,
                end: None,
            }),
            came: Condvar::new(),
        }
    }

    fn lock(&self) -> MutexGuard<'_, Waiting> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Gives a tick to the reader, and takes used columns for the next.
    pub(crate) fn publish(&self, columns: &mut Columns) {
        let mut waiting = self.lock();
        waiting.learn(columns);
        if waiting.fresh {
            waiting.replaced += 1;
        }
        columns.missed += waiting.replaced;
        std::mem::swap(&mut waiting.columns, columns);
        waiting.fresh = true;
        drop(waiting);
        self.came.notify_all();
    }

    /// Learns where the characters are, of columns that stay with the reader.
    pub(crate) fn learn(&self, columns: &Columns) {
        self.lock().learn(columns);
    }

    /// No further tick will come.
    pub(crate) fn end(&self, status: TroupeStatus, message: String) {
        self.lock().end = Some((status, message));
        self.came.notify_all();
    }

    /// Takes the newest tick into the reader's columns, if there is one. Waits for it as long as
    /// `limit`.
    pub(crate) fn take(&self, columns: &mut Columns, limit: Duration) -> Found {
        let until = Instant::now() + limit;
        let mut waiting = self.lock();
        loop {
            if waiting.fresh {
                waiting.fresh = false;
                std::mem::swap(&mut waiting.columns, columns);
                return Found::Newer;
            }
            if let Some((status, message)) = &waiting.end {
                return Found::Ended(*status, message.clone());
            }
            let left = until.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Found::Nothing;
            }
            let waited = self.came.wait_timeout(waiting, left);
            (waiting, _) = waited.unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// Where a character is, as far as its frames have come.
    pub(crate) fn place(&self, character: usize) -> Option<Vec3> {
        self.lock().places.get(character).copied()
    }
}

#[cfg(test)]
#[path = "columns_tests.rs"]
mod tests;
