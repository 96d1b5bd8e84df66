//! A film of gaits side by side at the same clock: [`take`] walks an episode, `sim`'s renderer draws it, `gif` and
//! `mp4` write the file.

mod gif;
mod mp4;
pub mod take;

use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use canter_sim::Robot;
use canter_sim::render::{Panel, RenderError, Renderer};

use self::gif::Gif;
use self::mp4::Mp4;
use self::take::{Clock, Shot, Take};
use crate::run_directory::RunError;

/// When a film's pictures are taken and how large they are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FilmSettings {
    /// When.
    pub clock: Clock,
    /// Width and height of a picture in pixels; even numbers, as video needs them.
    pub size: [u32; 2],
}

/// Why there is no film.
#[derive(Debug, thiserror::Error)]
pub enum FilmError {
    /// No pictures.
    #[error("cannot draw: {0}")]
    Render(#[from] RenderError),
    /// The file cannot be written.
    #[error(transparent)]
    Run(#[from] RunError),
    /// Neither of the two kinds of file.
    #[error("{}: the name of a film ends in .gif or .mp4", .0.display())]
    UnknownEnding(PathBuf),
    /// No program that writes video.
    #[error(
        "{}: the program ffmpeg writes .mp4 files, and it is not there; install it (Debian, Ubuntu: \
         `apt install ffmpeg`), or write a .gif file, which needs nothing", .0.display()
    )]
    NoFfmpeg(PathBuf),
    /// The program that writes video failed.
    #[error("{}: ffmpeg could not write it: {said}", .path.display())]
    Ffmpeg {
        /// The file.
        path: PathBuf,
        /// What ffmpeg said.
        said: String,
    },
    /// A gait whose first step makes no sense.
    #[error("the gait `{0}` is unstable from its first step on: there is nothing to show")]
    NothingToShow(String),
}

/// What a film is written as.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// 256 colours, shown by every browser, written without help.
    Gif,
    /// Video, written by the program ffmpeg.
    Mp4,
}

impl Format {
    /// The format that the ending of a file's name asks for.
    ///
    /// # Errors
    /// Another ending.
    pub fn of(path: &Path) -> Result<Self, FilmError> {
        let ending = path.extension().map(OsStr::to_ascii_lowercase);
        match ending.as_ref().and_then(|ending| ending.to_str()) {
            Some("gif") => Ok(Self::Gif),
            Some("mp4") => Ok(Self::Mp4),
            _ => Err(FilmError::UnknownEnding(path.to_owned())),
        }
    }
}

/// A film that grows picture by picture; the file is in its place when it is finished.
enum FilmFile {
    Gif(Box<Gif>),
    Mp4(Mp4),
}

impl FilmFile {
    /// `samples` are pictures that show every colour of the film.
    fn create(path: &Path, settings: &FilmSettings, samples: impl FnOnce() -> Vec<u8>) -> Result<Self, FilmError> {
        Ok(match Format::of(path)? {
            Format::Gif => Self::Gif(Box::new(Gif::create(path, settings, &samples())?)),
            Format::Mp4 => Self::Mp4(Mp4::create(path, settings)?),
        })
    }

    fn push(&mut self, rgb: &[u8]) -> Result<(), FilmError> {
        match self {
            Self::Gif(gif) => Ok(gif.push(rgb)?),
            Self::Mp4(mp4) => mp4.push(rgb),
        }
    }

    fn finish(self) -> Result<(), FilmError> {
        match self {
            Self::Gif(gif) => Ok(gif.finish()?),
            Self::Mp4(mp4) => mp4.finish(),
        }
    }
}

/// Pictures from which a GIF's colours are chosen, spread over the film.
const NUM_SAMPLES: usize = 6;

/// Draws takes of the same robot and ground from left to right and writes the film to `path`, whole or not at all.
///
/// `go_on` is told after each picture how many there are so far; the film is given up when it says no. Returns whether
/// the film was finished.
///
/// # Errors
/// No OpenGL, no ffmpeg for an .mp4 file, or a file that cannot be written.
pub fn film(
    path: &Path,
    robot: &Robot,
    takes: &[Take],
    settings: &FilmSettings,
    go_on: &mut dyn FnMut(usize) -> bool,
) -> Result<bool, FilmError> {
    let slope_deg = takes.first().map_or(0.0, |take| take.slope_deg);
    // Every gait walks from the same start, and so on the same ground.
    let mut renderer = match takes.first().and_then(|take| take.terrain.as_ref()) {
        Some(terrain) => Renderer::on_terrain(robot, terrain, settings.size, slope_deg.to_radians())?,
        None => Renderer::new(robot, settings.size, slope_deg.to_radians())?,
    };
    let num_frames = settings.clock.num_frames();
    let samples = || {
        let numbers = (0..NUM_SAMPLES).map(|i| i * num_frames / NUM_SAMPLES);
        numbers.flat_map(|number| draw(&mut renderer, takes, number).to_vec()).collect()
    };
    let mut file = FilmFile::create(path, settings, samples)?;
    for number in 0..num_frames {
        file.push(draw(&mut renderer, takes, number))?;
        if !go_on(number + 1) {
            return Ok(false);
        }
    }
    file.finish()?;
    Ok(true)
}

/// One picture of the film.
fn draw<'a>(renderer: &'a mut Renderer, takes: &[Take], number: usize) -> &'a [u8] {
    let captions: Vec<_> = takes.iter().map(|take| captions(take, &take.shots[number])).collect();
    let panels: Vec<_> = takes
        .iter()
        .zip(&captions)
        .map(|(take, (subtitle, footer))| {
            let shot = &take.shots[number];
            Panel { pose: &shot.pose, target: shot.target_m, title: &take.label, subtitle, footer }
        })
        .collect();
    renderer.draw(&panels)
}

/// The line under the title, and the one at the bottom.
fn captions(take: &Take, shot: &Shot) -> (String, String) {
    let speed = format!("{:.2} m/s", shot.distance_m / shot.time_s);
    let way = format!("{:.1} s   {:.2} m", shot.time_s, shot.distance_m);
    let slope = match take.slope_deg {
        0.0 => String::new(),
        slope if slope > 0.0 => format!("   {slope} deg uphill"),
        slope => format!("   {} deg downhill", -slope),
    };
    let accident = match take.accident {
        Some((accident, time_s)) if shot.time_s >= time_s => {
            format!("   {} after {time_s:.1} s", accident.name().replace('_', " "))
        }
        _ => String::new(),
    };
    (speed, format!("{way}{slope}{accident}"))
}
