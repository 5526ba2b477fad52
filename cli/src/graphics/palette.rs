//! The few colours of a picture that has many.

use std::collections::HashMap;

use color_quant::NeuQuant;

/// Red, green and blue.
pub(crate) type Rgb = [u8; 3];

/// The most frequent colours are kept as they are: so many of them.
const FLAT: usize = 60;
/// Share of the other colours that the network learns from: all of them.
const SAMPLE: i32 = 1;

/// Colours that are no farther apart than this are the same: what is drawn over its own colour
/// comes out a little off.
const SAME: u32 = 6;

/// How different two colours are: the sum over the channels.
pub(super) fn apart(a: Rgb, b: Rgb) -> u32 {
    a.iter().zip(b).map(|(a, b)| u32::from(a.abs_diff(b))).sum()
}

/// A few colours that stand for many.
pub(super) struct Palette {
    /// Colours that are kept.
    flat: Vec<Rgb>,
    /// Colours that stand for all others. None if all are kept.
    others: Option<NeuQuant>,
    /// Indices found before.
    known: HashMap<Rgb, u8>,
}

impl Palette {
    /// At most `most` colours, 124 to 256, for these pixels.
    pub(super) fn of(pixels: impl Iterator<Item = Rgb>, most: usize) -> Self {
        let mut counts: HashMap<Rgb, usize> = HashMap::new();
        pixels.for_each(|pixel| *counts.entry(pixel).or_default() += 1);
        let mut colours: Vec<(Rgb, usize)> = counts.into_iter().collect();
        // Equal counts in an order that does not depend on the map's.
        colours.sort_unstable_by_key(|&(colour, count)| (std::cmp::Reverse(count), colour));
        let (mut flat, mut others): (Vec<Rgb>, Vec<Rgb>) = (Vec::new(), Vec::new());
        let room = if colours.len() > most { FLAT } else { most };
        for (colour, _) in colours {
            let is_known = || flat.iter().any(|known| apart(*known, colour) <= SAME);
            if room == FLAT && is_known() {
                continue;
            }
            match flat.len() < room {
                true => flat.push(colour),
                false => others.push(colour),
            }
        }
        let others = (!others.is_empty()).then(|| {
            let pixels: Vec<u8> = others.iter().flat_map(|&[r, g, b]| [r, g, b, 255]).collect();
            NeuQuant::new(SAMPLE, most - flat.len(), &pixels)
        });
        let known = (0..=u8::MAX).zip(&flat).map(|(at, &colour)| (colour, at));
        Self {
            known: known.collect(),
            flat,
            others,
        }
    }

    /// The colours in order.
    pub(super) fn colours(&self) -> Vec<Rgb> {
        let others = self.others.as_ref().map(NeuQuant::color_map_rgb);
        let others = others.unwrap_or_default();
        let others = others.chunks_exact(3).map(|c| [c[0], c[1], c[2]]);
        self.flat.iter().copied().chain(others).collect()
    }

    /// Index of the colour that stands for another.
    pub(super) fn index(&mut self, colour: Rgb) -> u8 {
        let (flat, others) = (&self.flat, &self.others);
        *self.known.entry(colour).or_insert_with(|| {
            let [r, g, b] = colour;
            let same = flat.iter().position(|known| apart(*known, colour) <= SAME);
            let other = || others.as_ref().map_or(0, |of| of.index_of(&[r, g, b, 255]));
            let at = same.unwrap_or_else(|| flat.len() + other());
            u8::try_from(at).unwrap_or_default()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_colours_stay_as_they_are() {
        let colours = [[0, 0, 0], [255, 255, 255], [255, 255, 255], [10, 20, 30]];
        let mut palette = Palette::of(colours.into_iter(), 255);
        assert_eq!(palette.colours(), [[255, 255, 255], [0, 0, 0], [10, 20, 30]]);
        assert_eq!(palette.index([10, 20, 30]), 2);
    }

    #[test]
    fn many_colours_become_few_and_flat_areas_keep_theirs() {
        let ground = [246, 248, 250];
        let ramp = |v: u8| (0..=255).map(move |w| [v, w, 255 - v]);
        let pixels = (0..=255).step_by(17).flat_map(ramp);
        let mut palette = Palette::of(std::iter::repeat_n(ground, 10_000).chain(pixels.clone()), 255);
        let colours = palette.colours();
        assert_eq!(colours.len(), 255);
        assert_eq!(colours[usize::from(palette.index(ground))], ground);
        for colour in pixels {
            let near = colours[usize::from(palette.index(colour))];
            let apart = std::array::from_fn::<u8, 3, _>(|c| near[c].abs_diff(colour[c]));
            assert!(apart.iter().all(|d| *d < 32), "{colour:?} became {near:?}");
        }
    }
}
