//! Moving pictures, as animated PNG.
//!
//! Browsers and GitHub play them like any PNG. Other programs show the first frame. Of the formats
//! that play in a README they are the smallest for such drawings: a palette as in a GIF, but
//! deflated, and pixels that stay as they are cost almost nothing.

use png::{BitDepth, BlendOp, ColorType, Compression, DisposeOp, Encoder, EncodingError, Filter};

use super::palette::{Palette, Rgb, apart};

/// Colours beside the one that stands for "as before". More make the file larger, and the drawings
/// hardly better.
const COLOURS: usize = 127;
/// Changes that are not worth their bytes.
const UNSEEN: u32 = 24;
/// The index that stands for "as before".
const AS_BEFORE: u8 = 255;

/// Frames of one size, and how long each is shown.
#[derive(Debug)]
pub(crate) struct Animation {
    width: u32,
    height: u32,
    frames_per_second: u16,
    frames: Vec<Vec<Rgb>>,
}

impl Animation {
    /// Without a frame yet.
    pub(crate) fn new(width: u32, height: u32, frames_per_second: u16) -> Self {
        Self {
            width,
            height,
            frames_per_second,
            frames: Vec::new(),
        }
    }

    /// Adds a frame: its pixels, row by row.
    ///
    /// # Panics
    /// If it has another size.
    pub(crate) fn push(&mut self, frame: Vec<Rgb>) {
        assert_eq!(
            frame.len(),
            (self.width * self.height) as usize,
            "a frame of another size"
        );
        self.frames.push(frame);
    }

    /// The file, which plays for ever.
    ///
    /// # Errors
    /// A sentence, if it has no frame.
    pub(crate) fn to_png(&self) -> Result<Vec<u8>, String> {
        let mut palette = Palette::of(self.frames.iter().flatten().copied(), COLOURS);
        let colours = palette.colours();
        let mut frames: Vec<Vec<u8>> = Vec::with_capacity(self.frames.len());
        for frame in &self.frames {
            let mut now: Vec<u8> = frame.iter().map(|&pixel| palette.index(pixel)).collect();
            for (now, before) in now.iter_mut().zip(frames.last().into_iter().flatten()) {
                if apart(colours[usize::from(*now)], colours[usize::from(*before)]) <= UNSEEN {
                    *now = *before;
                }
            }
            frames.push(now);
        }
        self.encode(&frames, &colours).map_err(|e| e.to_string())
    }

    fn encode(&self, frames: &[Vec<u8>], colours: &[Rgb]) -> Result<Vec<u8>, EncodingError> {
        let mut file = Vec::new();
        let mut encoder = Encoder::new(&mut file, self.width, self.height);
        encoder.set_color(ColorType::Indexed);
        encoder.set_depth(BitDepth::Eight);
        let mut palette = colours.concat();
        palette.resize(3 * 256, 0);
        encoder.set_palette(palette);
        let mut opacity = [255; 256];
        opacity[usize::from(AS_BEFORE)] = 0;
        encoder.set_trns(&opacity[..]);
        encoder.set_compression(Compression::High);
        // Rows of indices are no numbers that could be predicted.
        encoder.set_filter(Filter::NoFilter);
        encoder.set_animated(u32::try_from(frames.len()).unwrap_or(u32::MAX), 0)?;
        encoder.set_frame_delay(1, self.frames_per_second)?;
        encoder.set_dispose_op(DisposeOp::None)?;
        encoder.set_blend_op(BlendOp::Over)?;
        let mut writer = encoder.write_header()?;
        let mut before: Option<&Vec<u8>> = None;
        for frame in frames {
            let area = before.map_or(Area::whole(self.width, self.height), |before| {
                Area::of_changes(before, frame, self.width as usize)
            });
            writer.set_frame_position(0, 0)?;
            writer.set_frame_dimension(area.width(), area.height())?;
            writer.set_frame_position(area.left, area.top)?;
            writer.write_image_data(&area.changes(before, frame, self.width as usize))?;
            before = Some(frame);
        }
        writer.finish()?;
        Ok(file)
    }
}

/// A rectangle of pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Area {
    left: u32,
    top: u32,
    /// The first that are outside.
    right: u32,
    bottom: u32,
}

impl Area {
    fn whole(width: u32, height: u32) -> Self {
        Self {
            left: 0,
            top: 0,
            right: width,
            bottom: height,
        }
    }

    /// The smallest rectangle around all changes; one pixel without a change.
    fn of_changes(before: &[u8], now: &[u8], width: usize) -> Self {
        let mut found: Option<Self> = None;
        for at in (0..now.len()).filter(|&at| before[at] != now[at]) {
            let (x, y) = ((at % width) as u32, (at / width) as u32);
            let area = found.get_or_insert(Self {
                left: x,
                top: y,
                right: x + 1,
                bottom: y + 1,
            });
            area.left = area.left.min(x);
            area.right = area.right.max(x + 1);
            area.bottom = y + 1;
        }
        found.unwrap_or(Self::whole(1, 1))
    }

    fn width(self) -> u32 {
        self.right - self.left
    }

    fn height(self) -> u32 {
        self.bottom - self.top
    }

    /// Its pixels of a frame, without those that are as before.
    fn changes(self, before: Option<&Vec<u8>>, now: &[u8], width: usize) -> Vec<u8> {
        let rows = (self.top..self.bottom).map(|y| y as usize * width);
        let places = rows.flat_map(|row| row + self.left as usize..row + self.right as usize);
        let pixel = |at: usize| match before {
            Some(before) if before[at] == now[at] => AS_BEFORE,
            _ => now[at],
        };
        places.map(pixel).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WHITE: Rgb = [255; 3];
    const BLUE: Rgb = [27, 111, 216];

    /// Plays a file, and gives every frame as it is seen.
    fn play(file: &[u8]) -> Vec<Vec<Rgb>> {
        let mut decoder = png::Decoder::new(std::io::Cursor::new(file));
        decoder.set_transformations(png::Transformations::EXPAND);
        let mut reader = decoder.read_info().unwrap();
        let (width, height) = (reader.info().width as usize, reader.info().height as usize);
        let count = reader.info().animation_control().unwrap().num_frames;
        let mut seen = vec![[0; 3]; width * height];
        let mut frames = Vec::new();
        for _ in 0..count {
            let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
            reader.next_frame(&mut pixels).unwrap();
            let control = reader.info().frame_control().unwrap();
            for (nth, pixel) in pixels
                .chunks(4)
                .take((control.width * control.height) as usize)
                .enumerate()
            {
                let x = control.x_offset as usize + nth % control.width as usize;
                let y = control.y_offset as usize + nth / control.width as usize;
                if pixel[3] > 0 {
                    seen[y * width + x] = [pixel[0], pixel[1], pixel[2]];
                }
            }
            frames.push(seen.clone());
        }
        frames
    }

    #[test]
    fn frames_are_seen_as_they_were_drawn() {
        let mut animation = Animation::new(4, 3, 20);
        // A dot that goes, stays, and is gone.
        let frame = |at: Option<usize>| -> Vec<Rgb> {
            let dot = |pixel| if Some(pixel) == at { BLUE } else { WHITE };
            (0..12).map(dot).collect()
        };
        let frames = [frame(Some(1)), frame(Some(6)), frame(Some(6)), frame(None)];
        frames.iter().for_each(|frame| animation.push(frame.clone()));
        assert_eq!(play(&animation.to_png().unwrap()), frames);
    }

    #[test]
    fn without_a_frame_there_is_no_file() {
        assert!(Animation::new(4, 3, 20).to_png().is_err());
    }
}
