//! The BVH reader.

use glam::DVec3;

use super::error::FoundFrames;
use super::{
    BvhError, BvhErrorKind, BvhFile, BvhJoint, Channel, MAX_DEPTH, MAX_FRAMES, MAX_JOINTS, name_is_writable,
};

/// Reads a BVH text.
///
/// # Errors
/// [`BvhError`] with the line. No text makes it panic.
pub fn parse(text: &str) -> Result<BvhFile, BvhError> {
    Ok(Reader::new(text, None).file()?.0)
}

/// A mistake of a BVH text that leaves no doubt about its motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MiscountedFrames {
    /// The number after `Frames:`.
    pub declared: usize,
    /// The rows that follow, one more or fewer.
    pub found: usize,
}

/// As [`parse`], but the number after `Frames:` may be one off, as some programs write it, and
/// `fps` replaces the file's rate.
///
/// # Errors
/// As [`parse`].
pub fn parse_tolerant(text: &str, fps: Option<f32>) -> Result<(BvhFile, Option<MiscountedFrames>), BvhError> {
    let tolerance = Tolerance {
        frame_time_s: fps.map(|fps| 1.0 / f64::from(fps)),
    };
    Reader::new(text, Some(tolerance)).file()
}

/// What a tolerant reader knows better than the text.
#[derive(Clone, Copy)]
struct Tolerance {
    /// Replaces the text's frame time.
    frame_time_s: Option<f64>,
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
    tolerance: Option<Tolerance>,
}

impl<'a> Reader<'a> {
    fn new(text: &'a str, tolerance: Option<Tolerance>) -> Self {
        Self {
            text: text.strip_prefix('\u{feff}').unwrap_or(text),
            pos: 0,
            line: 1,
            tolerance,
        }
    }

    fn file(mut self) -> Result<(BvhFile, Option<MiscountedFrames>), BvhError> {
        let joints = self.hierarchy()?;
        self.motion(joints)
    }

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

    fn motion(&mut self, joints: Vec<BvhJoint>) -> Result<(BvhFile, Option<MiscountedFrames>), BvhError> {
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
        let known = self.tolerance.and_then(|tolerance| tolerance.frame_time_s);
        let frame_time_s = known.unwrap_or(frame_time_s);
        // NaN too.
        if !(frame_time_s.is_finite() && frame_time_s > 0.0) {
            return Err(self.error(BvhErrorKind::FrameTime(frame_time_s)));
        }
        let values = self.rows(declared, channels)?;
        let found = values.len() / channels;
        let file = BvhFile {
            joints,
            frame_time_s,
            channels,
            values,
        };
        let miscounted = (found != declared).then_some(MiscountedFrames { declared, found });
        Ok((file, miscounted))
    }

    /// The rows of numbers, from after the frame time to the end of the text.
    fn rows(&mut self, declared: usize, channels: usize) -> Result<Vec<f64>, BvhError> {
        let rest = &self.text[self.pos..];
        let miscount = usize::from(self.tolerance.is_some());
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
                    if frames == declared + miscount {
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
        if frames.abs_diff(declared) > miscount || (frames == 0 && declared > 0) {
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
