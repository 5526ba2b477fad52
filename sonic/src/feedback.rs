//! What a robot says of itself: the topic `g1_debug` of its PUB socket, 50 times a second.

use std::time::Duration;

use serde::Deserialize;
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::TcpStream;
use tokio::sync::watch;
use tokio::time::{Instant, sleep, timeout};

use crate::zmtp::{Came, Inbox, greeting, ready, subscribe};

/// Topic of the feedback, in front of a MessagePack map.
const TOPIC: &[u8] = b"g1_debug";
/// Longest message, bytes.
const MAX_BYTES: usize = 1 << 20;
/// Pause before the next try to connect.
const PAUSE: Duration = Duration::from_secs(1);
/// A robot that is silent for this long is connected to again.
const SILENCE: Duration = Duration::from_secs(3);

/// The newest words of a robot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Feedback {
    /// Messages so far.
    pub count: u64,
    /// When the newest came.
    pub at: Instant,
    /// Angle between the pelvis and upright, radians.
    pub tilt_rad: f32,
    /// Largest angle between a hinge and its target, radians. None if the robot has no target.
    pub off_rad: Option<f32>,
}

/// The part of the map that is read.
#[derive(Debug, Default, Deserialize)]
#[serde(default)]
struct Message {
    base_quat: Vec<f64>,
    body_q: Vec<f64>,
    body_q_target: Vec<f64>,
}

impl Message {
    fn tilt_rad(&self) -> Option<f32> {
        let &[w, x, y, z] = self.base_quat.as_slice() else {
            return None;
        };
        let length = w * w + x * x + y * y + z * z;
        let up = 1.0 - 2.0 * (x * x + y * y) / length;
        up.is_finite().then(|| up.clamp(-1.0, 1.0).acos() as f32)
    }

    fn off_rad(&self) -> Option<f32> {
        if self.body_q.is_empty() || self.body_q.len() != self.body_q_target.len() {
            return None;
        }
        let pairs = self.body_q.iter().zip(&self.body_q_target);
        Some(pairs.map(|(is, target)| (is - target).abs()).fold(0.0, f64::max) as f32)
    }
}

/// Reads a message. None for other topics and for what is no such map.
fn read(body: &[u8], count: u64) -> Option<Feedback> {
    let message: Message = rmp_serde::from_slice(body.strip_prefix(TOPIC)?).ok()?;
    Some(Feedback {
        count,
        at: Instant::now(),
        tilt_rad: message.tilt_rad()?,
        off_rad: message.off_rad(),
    })
}

/// Listens to a robot until the bridge closes.
pub(crate) async fn listen(address: String, into: watch::Sender<Option<Feedback>>) {
    let mut count = 0;
    loop {
        // Whatever the reason, the next try may succeed.
        let _ = connect(&address, &mut count, &into).await;
        sleep(PAUSE).await;
    }
}

async fn connect(
    address: &str,
    count: &mut u64,
    into: &watch::Sender<Option<Feedback>>,
) -> std::io::Result<()> {
    let mut stream = timeout(SILENCE, TcpStream::connect(address)).await??;
    stream.write_all(&greeting()).await?;
    stream.write_all(&ready("SUB")).await?;
    let mut inbox = Inbox::new(MAX_BYTES);
    let mut buffer = vec![0; 1 << 14];
    loop {
        let read_bytes = timeout(SILENCE, stream.read(&mut buffer)).await??;
        if read_bytes == 0 {
            return Ok(());
        }
        inbox.push(&buffer[..read_bytes]);
        while let Some(came) = inbox.next().map_err(std::io::Error::other)? {
            match came {
                Came::Ready => stream.write_all(&subscribe(TOPIC)).await?,
                Came::Message(body) => {
                    if let Some(feedback) = read(&body, *count + 1) {
                        *count += 1;
                        into.send_replace(Some(feedback));
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_map_with_more_in_it_is_read() {
        // index: 7, base_quat: [√½, √½, 0, 0], body_q: [0.5, 0], name: "cpp",
        // body_q_target: [0.25, 0]
        let mut body = b"g1_debug\x85\xa5index\x07\xa9base_quat\x94".to_vec();
        let double = |number: f64| [&[0xcb][..], &number.to_be_bytes()].concat();
        for number in [0.5_f64.sqrt(), 0.5_f64.sqrt(), 0.0, 0.0] {
            body.extend(double(number));
        }
        body.extend(b"\xa6body_q\x92");
        body.extend([double(0.5), double(0.0)].concat());
        body.extend(b"\xa4name\xa3cpp\xadbody_q_target\x92");
        body.extend([double(0.25), vec![0]].concat());
        let feedback = read(&body, 3).unwrap();
        assert!((feedback.tilt_rad - std::f32::consts::FRAC_PI_2).abs() < 1e-6);
        assert_eq!((feedback.off_rad, feedback.count), (Some(0.25), 3));
    }

    #[test]
    fn other_messages_are_left_out() {
        assert_eq!(read(b"robot_config\x80", 1), None);
        assert_eq!(read(b"g1_debug\x80", 1), None);
        assert_eq!(read(b"g1_debug\xc1", 1), None);
        assert_eq!(read(b"g1_debug", 1), None);
    }
}
