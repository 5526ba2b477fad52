//! The BVH reader.

use glam::DVec3;

use super::{
    BvhFile, BvhJoint, Channel, MAX_DEPTH, MAX_FRAMES, MAX_JOINTS, MAX_NAME_BYTES, name_is_writable,
};

/// An error in a BVH text, with its line.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("line {line}: {kind}")]
pub struct BvhError {
    /// Line, counted from 1.
    pub line: usize,
    /// The error in that line.
    pub kind: BvhErrorKind,
}

/// Errors of a BVH text.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BvhErrorKind {
    /// Bytes that are not UTF-8.
    #[error("the text is not UTF-8")]
    NotUtf8,
    /// Something else stands where `expected` should stand.
    #[error("expected {expected}, found {found:?}")]
    Expected {
        /// What should stand there.
        expected: &'static str,
        /// What stands there, cut to a few characters; empty at the end of the text.
        found: String,
    },
    /// The text ends too early.
    #[error("the text ends where {0} should stand")]
    UnexpectedEnd(&'static str),
    /// A joint name that is empty, or longer than [`MAX_NAME_BYTES`].
    #[error("a joint name must have 1 to {MAX_NAME_BYTES} bytes")]
    Name,
    /// OFFSET or CHANNELS stands twice in a joint, or after its children.
    #[error("{0} may stand once in a joint, before its children")]
    Repeated(&'static str),
    /// A joint or End Site has no OFFSET.
    #[error("{0:?} has no OFFSET")]
    NoOffset(String),
    /// The number of channels is not 0 to 6.
    #[error("the number of channels must be 0 to 6, not {0:?}")]
    ChannelCount(String),
    /// A joint has a channel twice.
    #[error("channel {0} stands twice in one joint")]
    DuplicateChannel(&'static str),
    /// No joint has channels, so there can be no motion.
    #[error("no joint has channels")]
    NoChannels,
    /// Something exceeds a limit.
    #[error("more than {limit} {what}")]
    TooMany {
        /// What there is too much of.
        what: &'static str,
        /// The most that is allowed.
        limit: usize,
    },
    /// NaN, infinity, or a number too large for double precision.
    #[error("{0:?} is not a finite number")]
    NotFinite(String),
    /// A frame time that is not positive.
    #[error("the frame time must be positive, not {0}")]
    FrameTime(f64),
    /// A row has too few or too many numbers.
    #[error("frame {frame} has {found} values for {expected} channels")]
    RowLength {
        /// Index of the frame, from 0.
        frame: usize,
        /// Numbers in the row; counting stops at one more than `expected`.
        found: usize,
        /// Channels of the hierarchy.
        expected: usize,
    },
    /// There are more or fewer rows than declared.
    #[error("{declared} frames are declared, but there {found}")]
    FrameCount {
        /// The number after `Frames:`.
        declared: usize,
        /// The rows that there are.
        found: FoundFrames,
    },
}

/// Number of rows, compared with the declared number.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum FoundFrames {
    /// Fewer rows: this many.
    #[error("are {0}")]
    Only(usize),
    /// At least one more.
    #[error("are more")]
    More,
}

/// Reads a BVH text.
///
/// # Errors
/// [`BvhError`] with the line. No text makes it panic.
pub fn parse(text: &str) -> Result<BvhFile, BvhError> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let mut reader = Reader {
        text,
        pos: 0,
        line: 1,
    };
    let joints = reader.hierarchy()?;
    reader.motion(joints)
}

/// [`parse`] for bytes, which must be UTF-8.
///
/// # Errors
/// [`BvhErrorKind::NotUtf8`] with the line of the first bad byte, or as [`parse`].
pub fn parse_bytes(bytes: &[u8]) -> Result<BvhFile, BvhError> {
    match std::str::from_utf8(bytes) {
        Ok(text) => parse(text),
        Err(error) => {
            let line = 1 + bytes[..error.valid_up_to()]
                .iter()
                .filter(|&&b| b == b'\n')
                .count();
            Err(BvhError {
                line,
                kind: BvhErrorKind::NotUtf8,
            })
        }
    }
}

/// A joint whose `}` has not been read yet.
struct Open {
    joint: usize,
    offset: bool,
    channels: bool,
    children: bool,
}

struct Reader<'a> {
    text: &'a str,
    pos: usize,
    line: usize,
}

impl<'a> Reader<'a> {
    fn error(&self, kind: BvhErrorKind) -> BvhError {
        BvhError {
            line: self.line,
            kind,
        }
    }

    fn skip_space(&mut self) {
        for &byte in &self.text.as_bytes()[self.pos..] {
            match byte {
                b'\n' => self.line += 1,
                b' ' | b'\t' | b'\r' | 0x0b | 0x0c => {}
                _ => break,
            }
            self.pos += 1;
        }
    }

    /// The next word, `{`, `}` or `:`; empty at the end of the text.
    fn token(&mut self) -> &'a str {
        self.skip_space();
        let rest = &self.text[self.pos..];
        let end = rest
            .bytes()
            .position(|b| b.is_ascii_whitespace() || matches!(b, b'{' | b'}' | b':' | 0x0b))
            .unwrap_or(rest.len());
        let end = if end == 0 && !rest.is_empty() { 1 } else { end };
        self.pos += end;
        &rest[..end]
    }

    fn unexpected(&self, expected: &'static str, found: &str) -> BvhError {
        self.error(if found.is_empty() {
            BvhErrorKind::UnexpectedEnd(expected)
        } else {
            BvhErrorKind::Expected {
                expected,
                found: shorten(found),
            }
        })
    }

    fn expect(&mut self, expected: &'static str) -> Result<(), BvhError> {
        let found = self.token();
        if found.eq_ignore_ascii_case(expected) {
            Ok(())
        } else {
            Err(self.unexpected(expected, found))
        }
    }

    fn number(&mut self) -> Result<f64, BvhError> {
        let token = self.token();
        number(token).map_err(|kind| self.error(kind))
    }

    fn vector(&mut self) -> Result<DVec3, BvhError> {
        Ok(DVec3::new(self.number()?, self.number()?, self.number()?))
    }

    /// The rest of the line up to `{`, without space at its ends.
    fn name(&mut self) -> Result<String, BvhError> {
        self.skip_space();
        let rest = &self.text[self.pos..];
        let end = rest.find(['\n', '\r', '{']).unwrap_or(rest.len());
        let name = rest[..end].trim();
        if !name_is_writable(name) {
            return Err(self.error(BvhErrorKind::Name));
        }
        self.pos += end;
        Ok(name.to_owned())
    }

    fn hierarchy(&mut self) -> Result<Vec<BvhJoint>, BvhError> {
        self.expect("HIERARCHY")?;
        let mut joints = Vec::new();
        let mut open: Vec<Open> = Vec::new();
        loop {
            let token = self.token();
            let Some(top) = open.last_mut() else {
                if token.eq_ignore_ascii_case("ROOT") {
                    open.push(self.begin_joint(&mut joints, None)?);
                } else if token.eq_ignore_ascii_case("MOTION") && !joints.is_empty() {
                    return Ok(joints);
                } else {
                    return Err(self.unexpected(if joints.is_empty() { "ROOT" } else { "MOTION" }, token));
                }
                continue;
            };
            let joint = top.joint;
            match token.to_ascii_uppercase().as_str() {
                "OFFSET" if top.offset || top.children => {
                    return Err(self.error(BvhErrorKind::Repeated("OFFSET")));
                }
                "OFFSET" => {
                    top.offset = true;
                    joints[joint].offset = self.vector()?;
                }
                "CHANNELS" if top.channels || top.children => {
                    return Err(self.error(BvhErrorKind::Repeated("CHANNELS")));
                }
                "CHANNELS" => {
                    top.channels = true;
                    joints[joint].channels = self.channels()?;
                }
                "JOINT" => {
                    top.children = true;
                    if open.len() >= MAX_DEPTH {
                        return Err(self.error(BvhErrorKind::TooMany {
                            what: "nested joints",
                            limit: MAX_DEPTH,
                        }));
                    }
                    open.push(self.begin_joint(&mut joints, Some(joint))?);
                }
                "END" => {
                    top.children = true;
                    let site = self.end_site()?;
                    joints[joint].end_sites.push(site);
                }
                "}" if !top.offset => {
                    return Err(self.error(BvhErrorKind::NoOffset(joints[joint].name.clone())));
                }
                "}" => {
                    open.pop();
                }
                _ => return Err(self.unexpected("OFFSET, CHANNELS, JOINT, End Site or }", token)),
            }
        }
    }

    fn begin_joint(&mut self, joints: &mut Vec<BvhJoint>, parent: Option<usize>) -> Result<Open, BvhError> {
        if joints.len() >= MAX_JOINTS {
            return Err(self.error(BvhErrorKind::TooMany {
                what: "joints",
                limit: MAX_JOINTS,
            }));
        }
        let name = self.name()?;
        self.expect("{")?;
        let joint = joints.len();
        joints.push(BvhJoint {
            name,
            parent,
            offset: DVec3::ZERO,
            channels: Vec::new(),
            end_sites: Vec::new(),
        });
        Ok(Open {
            joint,
            offset: false,
            channels: false,
            children: false,
        })
    }

    fn channels(&mut self) -> Result<Vec<Channel>, BvhError> {
        let token = self.token();
        let count = match token.parse::<usize>() {
            Ok(count) if count <= Channel::ALL.len() => count,
            _ => return Err(self.error(BvhErrorKind::ChannelCount(shorten(token)))),
        };
        let mut channels = Vec::with_capacity(count);
        for _ in 0..count {
            let token = self.token();
            let Some(channel) = Channel::ALL
                .into_iter()
                .find(|c| c.name().eq_ignore_ascii_case(token))
            else {
                return Err(self.unexpected("a channel such as Xposition or Zrotation", token));
            };
            if channels.contains(&channel) {
                return Err(self.error(BvhErrorKind::DuplicateChannel(channel.name())));
            }
            channels.push(channel);
        }
        Ok(channels)
    }

    /// What follows `End`: `Site`, an optional name, and a block with one OFFSET.
    fn end_site(&mut self) -> Result<DVec3, BvhError> {
        self.expect("Site")?;
        while self.text[self.pos..].starts_with([' ', '\t']) {
            self.pos += 1;
        }
        // Some writers give the site a name.
        let rest = &self.text[self.pos..];
        self.pos += rest.find(['\n', '\r', '{']).unwrap_or(rest.len());
        self.expect("{")?;
        let token = self.token();
        if token == "}" {
            return Err(self.error(BvhErrorKind::NoOffset("End Site".to_owned())));
        }
        if !token.eq_ignore_ascii_case("OFFSET") {
            return Err(self.unexpected("OFFSET", token));
        }
        let offset = self.vector()?;
        self.expect("}")?;
        Ok(offset)
    }

    fn motion(&mut self, joints: Vec<BvhJoint>) -> Result<BvhFile, BvhError> {
        let channels: usize = joints.iter().map(|j| j.channels.len()).sum();
        if channels == 0 {
            return Err(self.error(BvhErrorKind::NoChannels));
        }
        self.expect("Frames")?;
        self.expect(":")?;
        let token = self.token();
        let Ok(declared) = token.parse::<usize>() else {
            return Err(self.unexpected("the number of frames", token));
        };
        if declared > MAX_FRAMES {
            return Err(self.error(BvhErrorKind::TooMany {
                what: "frames",
                limit: MAX_FRAMES,
            }));
        }
        self.expect("Frame")?;
        self.expect("Time")?;
        self.expect(":")?;
        let frame_time_s = self.number()?;
        if frame_time_s <= 0.0 {
            return Err(self.error(BvhErrorKind::FrameTime(frame_time_s)));
        }
        let values = self.rows(declared, channels)?;
        Ok(BvhFile {
            joints,
            frame_time_s,
            channels,
            values,
        })
    }

    /// The rows of numbers, from after the frame time to the end of the text.
    fn rows(&mut self, declared: usize, channels: usize) -> Result<Vec<f64>, BvhError> {
        let rest = &self.text[self.pos..];
        // Every value takes at least two bytes of text, so the text limits the memory.
        let mut values = Vec::with_capacity(declared.saturating_mul(channels).min(rest.len() / 2 + 1));
        let mut frames = 0;
        for (nth, line) in rest.split('\n').enumerate() {
            // The first piece is the rest of the frame time's line.
            if nth > 0 {
                self.line += 1;
            }
            // A lone carriage return ends a row too.
            for row in line.split('\r') {
                let before = values.len();
                for token in row.split_ascii_whitespace() {
                    if values.len() - before == channels {
                        let kind = BvhErrorKind::RowLength {
                            frame: frames,
                            found: channels + 1,
                            expected: channels,
                        };
                        return Err(self.error(kind));
                    }
                    if frames == declared {
                        let kind = BvhErrorKind::FrameCount {
                            declared,
                            found: FoundFrames::More,
                        };
                        return Err(self.error(kind));
                    }
                    values.push(number(token).map_err(|kind| self.error(kind))?);
                }
                match values.len() - before {
                    0 => {}
                    found if found == channels => frames += 1,
                    found => {
                        let kind = BvhErrorKind::RowLength {
                            frame: frames,
                            found,
                            expected: channels,
                        };
                        return Err(self.error(kind));
                    }
                }
            }
        }
        if frames != declared {
            let kind = BvhErrorKind::FrameCount {
                declared,
                found: FoundFrames::Only(frames),
            };
            return Err(self.error(kind));
        }
        Ok(values)
    }
}

/// A finite number in decimal notation.
fn number(token: &str) -> Result<f64, BvhErrorKind> {
    if token.is_empty() {
        return Err(BvhErrorKind::UnexpectedEnd("a number"));
    }
    match token.parse::<f64>() {
        Ok(v) if v.is_finite() => Ok(v),
        Ok(_) => Err(BvhErrorKind::NotFinite(shorten(token))),
        // What C libraries print for NaN and infinity: nan(ind), -1.#IND, 1.#INF, 1.#QNAN.
        Err(_) if token.contains('#') || token.to_ascii_lowercase().contains("nan") => {
            Err(BvhErrorKind::NotFinite(shorten(token)))
        }
        Err(_) => Err(BvhErrorKind::Expected {
            expected: "a number",
            found: shorten(token),
        }),
    }
}

/// At most 40 characters of `text`, for messages.
fn shorten(text: &str) -> String {
    text.chars().take(40).collect()
}
