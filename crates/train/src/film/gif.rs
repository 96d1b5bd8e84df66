//! A film as an animated GIF: one palette for all pictures, and only what changes in each.

use std::collections::HashMap;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

use color_quant::NeuQuant;
use gif::{Encoder, EncodingError, Frame, Repeat};

use super::FilmSettings;
use crate::run_directory::{RunError, UnfinishedFile, io_error};

/// Colours of a picture; one more stands for "as before".
const NUM_COLOURS: usize = 255;
const AS_BEFORE: u8 = 255;

/// Every how many pixels of the samples the palette is made from: finer takes longer and looks the same.
const SAMPLE_EVERY: i32 = 7;

/// A growing GIF.
pub struct Gif {
    encoder: Encoder<BufWriter<File>>,
    file: UnfinishedFile,
    palette: NeuQuant,
    /// Palette entries of the colours that were met so far.
    entries: HashMap<[u8; 3], u8>,
    /// The entries of the last picture.
    shown: Vec<u8>,
    settings: FilmSettings,
    num_frames: u32,
}

impl Gif {
    /// A GIF that repeats for ever. `samples` are pixels, three bytes each, with the film's colours.
    pub fn create(path: &Path, settings: &FilmSettings, samples: &[u8]) -> Result<Self, RunError> {
        let opaque: Vec<u8> = samples.chunks_exact(3).flat_map(|rgb| [rgb[0], rgb[1], rgb[2], u8::MAX]).collect();
        let palette = NeuQuant::new(SAMPLE_EVERY, NUM_COLOURS, &opaque);
        let [width, height] = settings.size.map(|pixels| u16::try_from(pixels).expect("a GIF is smaller than 2^16"));
        let file = UnfinishedFile::create(path)?;
        let writer = file.file.try_clone().map_err(|source| io_error(path, source))?;
        let begin = || {
            let mut encoder = Encoder::new(BufWriter::new(writer), width, height, &palette.color_map_rgb())?;
            encoder.set_repeat(Repeat::Infinite)?;
            Ok(encoder)
        };
        let encoder = begin().map_err(|error| io_error(path, system_error(error)))?;
        Ok(Self {
            encoder,
            file,
            palette,
            entries: HashMap::new(),
            shown: Vec::new(),
            settings: *settings,
            num_frames: 0,
        })
    }

    /// Adds a picture.
    pub fn push(&mut self, rgb: &[u8]) -> Result<(), RunError> {
        let entries: Vec<u8> = rgb.chunks_exact(3).map(|pixel| self.entry([pixel[0], pixel[1], pixel[2]])).collect();
        let changes = if self.shown.is_empty() {
            entries.clone()
        } else {
            entries.iter().zip(&self.shown).map(|(&new, &old)| if new == old { AS_BEFORE } else { new }).collect()
        };
        let frame = Frame {
            delay: delay_hundredths(self.num_frames, self.settings.clock.frames_per_s),
            transparent: Some(AS_BEFORE),
            width: self.settings.size[0] as u16,
            height: self.settings.size[1] as u16,
            buffer: changes.into(),
            ..Frame::default()
        };
        self.shown = entries;
        self.num_frames += 1;
        self.encoder.write_frame(&frame).map_err(|error| io_error(self.file.path(), system_error(error)))
    }

    /// The palette entry that is nearest to a colour.
    fn entry(&mut self, rgb: [u8; 3]) -> u8 {
        let [r, g, b] = rgb;
        *self.entries.entry(rgb).or_insert_with(|| self.palette.index_of(&[r, g, b, u8::MAX]) as u8)
    }

    /// Puts the file into its place.
    pub fn finish(self) -> Result<(), RunError> {
        let end = || self.encoder.into_inner()?.flush().map_err(EncodingError::from);
        end().map_err(|error| io_error(self.file.path(), system_error(error)))?;
        self.file.finish()
    }
}

/// How long picture `number` is shown, so that on the whole the film keeps its clock [1/100 s].
fn delay_hundredths(number: u32, frames_per_s: u32) -> u16 {
    let begin = |number: u32| (200 * number + frames_per_s) / (2 * frames_per_s);
    (begin(number + 1) - begin(number)) as u16
}

fn system_error(error: EncodingError) -> io::Error {
    match error {
        EncodingError::Io(error) => error,
        other => io::Error::other(other),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hundredths_of_a_second_add_up() {
        let delays = |frames_per_s| (0..frames_per_s).map(move |number| delay_hundredths(number, frames_per_s));
        for frames_per_s in 1..=50 {
            assert_eq!(delays(frames_per_s).map(u32::from).sum::<u32>(), 100, "{frames_per_s}");
        }
        assert_eq!(delays(25).collect::<Vec<_>>(), [4; 25]);
        assert_eq!(delays(30).take(4).collect::<Vec<_>>(), [3, 4, 3, 3]);
    }
}
