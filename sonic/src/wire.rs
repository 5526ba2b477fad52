//! Messages of SONIC's deployed controller: a topic, a JSON header of 1280 bytes, then the numbers
//! of its fields, little-endian.

use std::fmt::Write as _;

/// Bytes of the header, filled up with zeros.
pub const HEADER_BYTES: usize = 1280;
/// Hinges of a G1.
pub const HINGES: usize = 29;
/// Topic of windows of frames.
pub const POSE: &[u8] = b"pose";
/// Topic of start, stop and mode.
pub const COMMAND: &[u8] = b"command";

/// For each hinge in Isaac Lab's order, its index in MuJoCo's. Poses go out in Isaac Lab's order,
/// feedback comes in MuJoCo's.
pub const ISAAC: [usize; HINGES] = [
    0, 6, 12, 1, 7, 13, 2, 8, 14, 3, 9, 15, 22, 4, 10, 16, 23, 5, 11, 17, 24, 18, 25, 19, 26, 20, 27, 21, 28,
];

/// Control of a robot begins, takes poses, or ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Command {
    /// Begin control. The robot takes it only in the mode of its own planner.
    Start,
    /// Follow poses.
    Follow,
    /// End control. The motors let go.
    End,
}

impl Command {
    /// The whole message.
    pub fn message(self) -> Vec<u8> {
        let (start, stop, planner) = match self {
            Self::Start => (1, 0, 1),
            Self::Follow => (0, 0, 0),
            Self::End => (0, 1, 0),
        };
        let mut out = Vec::with_capacity(COMMAND.len() + HEADER_BYTES + 3);
        let field = |name| (name, "u8", [1, 0]);
        header(
            &mut out,
            COMMAND,
            &[field("start"), field("stop"), field("planner")],
        );
        out.extend([start, stop, planner]);
        out
    }
}

/// Consecutive frames, 50 a second.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Window {
    /// Index of the first frame.
    pub first: u64,
    /// Hinge angles of each frame in MuJoCo's order, radians.
    pub angles: Vec<[f32; HINGES]>,
    /// Hinge speeds of each frame in MuJoCo's order, rad/s.
    pub speeds: Vec<[f32; HINGES]>,
    /// Rotation of the pelvis in each frame, w x y z, in a world whose Z is up.
    pub turns: Vec<[f32; 4]>,
}

impl Window {
    /// Writes the whole message into a buffer that is cleared first.
    pub fn write(&self, out: &mut Vec<u8>) {
        out.clear();
        let frames = self.angles.len();
        let of_hinges = |name| (name, "f32", [frames, HINGES]);
        let fields = [
            of_hinges("joint_pos"),
            of_hinges("joint_vel"),
            ("body_quat", "f32", [frames, 4]),
            ("frame_index", "i64", [frames, 0]),
        ];
        header(out, POSE, &fields);
        for rows in [&self.angles, &self.speeds] {
            for row in rows {
                out.extend(ISAAC.iter().flat_map(|&hinge| row[hinge].to_le_bytes()));
            }
        }
        out.extend(
            self.turns
                .iter()
                .flatten()
                .flat_map(|number| number.to_le_bytes()),
        );
        out.extend((self.first..).take(frames).flat_map(|index| index.to_le_bytes()));
    }
}

/// Writes topic and header. A field has a name, a type, and a shape of one or two numbers; 0 ends
/// the shape.
fn header(out: &mut Vec<u8>, topic: &[u8], fields: &[(&str, &str, [usize; 2])]) {
    let mut text = r#"{"v":1,"endian":"le","count":1,"fields":["#.to_owned();
    for (nth, (name, dtype, shape)) in fields.iter().enumerate() {
        let comma = if nth == 0 { "" } else { "," };
        let shape = match shape {
            [one, 0] => one.to_string(),
            [one, two] => format!("{one},{two}"),
        };
        // Writing to a string does not fail.
        let _ = write!(
            text,
            r#"{comma}{{"name":"{name}","dtype":"{dtype}","shape":[{shape}]}}"#
        );
    }
    text.push_str("]}");
    out.extend(topic);
    out.extend(text.bytes());
    out.resize(topic.len() + HEADER_BYTES, 0);
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The header's text and the data of a message.
    fn split<'a>(message: &'a [u8], topic: &[u8]) -> (&'a str, &'a [u8]) {
        let rest = message.strip_prefix(topic).unwrap();
        let (header, data) = rest.split_at(1280);
        let end = header.iter().position(|&byte| byte == 0).unwrap();
        assert!(header[end..].iter().all(|&byte| byte == 0));
        (std::str::from_utf8(&header[..end]).unwrap(), data)
    }

    #[test]
    fn commands_are_as_the_robot_reads_them() {
        let fields = r#"{"v":1,"endian":"le","count":1,"fields":[{"name":"start","dtype":"u8","shape":[1]},{"name":"stop","dtype":"u8","shape":[1]},{"name":"planner","dtype":"u8","shape":[1]}]}"#;
        for (command, data) in [
            (Command::Start, [1, 0, 1]),
            (Command::Follow, [0, 0, 0]),
            (Command::End, [0, 1, 0]),
        ] {
            assert_eq!(split(&command.message(), b"command"), (fields, &data[..]));
        }
    }

    #[test]
    fn a_window_is_as_the_robot_reads_it() {
        let hinges = |of: fn(usize) -> f32| std::array::from_fn(of);
        let window = Window {
            first: 0x0102,
            angles: vec![hinges(|nth| nth as f32), hinges(|nth| -(nth as f32))],
            speeds: vec![hinges(|nth| 100.0 + nth as f32), [0.5; HINGES]],
            turns: vec![[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]],
        };
        let mut message = b"left over".to_vec();
        window.write(&mut message);
        let (header, data) = split(&message, b"pose");
        assert_eq!(
            header,
            r#"{"v":1,"endian":"le","count":1,"fields":[{"name":"joint_pos","dtype":"f32","shape":[2,29]},{"name":"joint_vel","dtype":"f32","shape":[2,29]},{"name":"body_quat","dtype":"f32","shape":[2,4]},{"name":"frame_index","dtype":"i64","shape":[2]}]}"#
        );
        assert_eq!(data.len(), 2 * (29 * 4 + 29 * 4 + 4 * 4 + 8));
        // 0.0, 6.0 and 12.0: the hip pitches left and right, then the waist's yaw.
        assert_eq!(&data[..12], [0, 0, 0, 0, 0, 0, 0xc0, 0x40, 0, 0, 0x40, 0x41]);
        // -0.0 and -6.0.
        assert_eq!(&data[116..124], [0, 0, 0, 0x80, 0, 0, 0xc0, 0xc0]);
        // 100.0 and 106.0.
        assert_eq!(&data[232..240], [0, 0, 0xc8, 0x42, 0, 0, 0xd4, 0x42]);
        // w first.
        assert_eq!(&data[464..472], [0, 0, 0x80, 0x3f, 0, 0, 0, 0]);
        assert_eq!(&data[492..496], [0, 0, 0x80, 0x3f]);
        assert_eq!(&data[496..], [2, 1, 0, 0, 0, 0, 0, 0, 3, 1, 0, 0, 0, 0, 0, 0]);
    }
}
