//! A film as video: the program ffmpeg gets the pictures and writes the file.

use std::io::{ErrorKind, Read, Write};
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Child, Command, Stdio};

use super::{FilmError, FilmSettings};
use crate::run_directory::UnfinishedFile;

/// A growing video.
pub struct Mp4 {
    ffmpeg: Ffmpeg,
    file: UnfinishedFile,
}

/// The running program; killed when it is dropped before its end.
struct Ffmpeg(Child);

impl Mp4 {
    pub fn create(path: &Path, settings: &FilmSettings) -> Result<Self, FilmError> {
        let file = UnfinishedFile::create(path)?;
        let [width, height] = settings.size;
        let mut ffmpeg = Command::new("ffmpeg");
        ffmpeg.args(["-hide_banner", "-loglevel", "error", "-y", "-f", "rawvideo", "-pixel_format", "rgb24"]);
        ffmpeg.args([
            "-video_size",
            &format!("{width}x{height}"),
            "-framerate",
            &settings.clock.frames_per_s.to_string(),
        ]);
        // Most players show nothing but yuv420p; faststart lets a browser begin before it has the whole file.
        ffmpeg.args(["-i", "-", "-pix_fmt", "yuv420p", "-movflags", "+faststart", "-f", "mp4"]);
        ffmpeg.arg(file.temporary_path());
        ffmpeg.stdin(Stdio::piped()).stdout(Stdio::null()).stderr(Stdio::piped());
        // Out of the terminal's reach: Ctrl-C is ours to deal with.
        ffmpeg.process_group(0);
        let child = ffmpeg.spawn().map_err(|error| match error.kind() {
            ErrorKind::NotFound => FilmError::NoFfmpeg(path.to_owned()),
            _ => FilmError::Ffmpeg { path: path.to_owned(), said: error.to_string() },
        })?;
        Ok(Self { ffmpeg: Ffmpeg(child), file })
    }

    /// Adds a picture.
    pub fn push(&mut self, rgb: &[u8]) -> Result<(), FilmError> {
        let stdin = self.ffmpeg.0.stdin.as_mut().expect("a pipe until the end");
        // A pipe that breaks means that ffmpeg has something to say.
        stdin.write_all(rgb).or_else(|_| self.ffmpeg.end(self.file.path()))
    }

    /// Waits for ffmpeg's end and puts the file into its place.
    pub fn finish(mut self) -> Result<(), FilmError> {
        self.ffmpeg.end(self.file.path())?;
        Ok(self.file.finish()?)
    }
}

impl Ffmpeg {
    /// Ends the pictures and waits.
    fn end(&mut self, path: &Path) -> Result<(), FilmError> {
        drop(self.0.stdin.take());
        let mut said = String::new();
        let read = self.0.stderr.take().map_or(Ok(0), |mut stderr| stderr.read_to_string(&mut said));
        match read.and_then(|_| self.0.wait()) {
            Ok(status) if status.success() => Ok(()),
            Ok(_) => Err(FilmError::Ffmpeg { path: path.to_owned(), said: said.trim().to_owned() }),
            Err(error) => Err(FilmError::Ffmpeg { path: path.to_owned(), said: error.to_string() }),
        }
    }
}

impl Drop for Ffmpeg {
    fn drop(&mut self) {
        // Both fail after the end, which is no harm.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}
