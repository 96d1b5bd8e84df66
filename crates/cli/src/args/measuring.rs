//! Measuring and showing what was learned.

use std::net::{IpAddr, Ipv4Addr};
use std::path::PathBuf;

use clap::Args;

use super::WorkerThreads;

#[derive(Clone, Debug, Args)]
#[command(after_help = "\
Examples:
  canter eval runs/doggo-1-1                       the policy, its prior and the default gaits
  canter eval runs/doggo-1-1 --slope 10 --json     ten degrees uphill, for a program
  canter eval --robot doggo --prior stepping       a bare gait
  canter eval --robot hexapod                      every gait that a robot has

Every gait starts from the same random states. Speed is the forward displacement after the first second.")]
pub struct EvalArgs {
    /// The run directory of a trained policy
    #[arg(required_unless_present = "robot", conflicts_with_all = ["robot", "prior"])]
    pub run: Option<PathBuf>,
    /// Robot of a bare gait: a name (see `canter robots`) or the path of a robot.toml
    #[arg(long, value_name = "NAME")]
    pub robot: Option<String>,
    /// Name of a bare gait of that robot; all of them if not given
    #[arg(long, value_name = "NAME", requires = "robot")]
    pub prior: Option<String>,
    /// Slope of the ground in degrees, positive uphill
    #[arg(long, value_name = "DEG", allow_negative_numbers = true)]
    pub slope: Option<f64>,
    /// Sliding friction between feet and ground
    #[arg(long, value_name = "X", allow_negative_numbers = true)]
    pub friction: Option<f64>,
    /// Episodes of each gait
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub episodes: Option<usize>,
    /// Seed of the random starts
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub seed: Option<u64>,
    #[command(flatten)]
    pub workers: WorkerThreads,
    /// Print JSON instead of a table
    #[arg(long)]
    pub json: bool,
}

#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  canter robustness runs/doggo-robust-1-1          one policy under every condition
  canter robustness runs/doggo-* --json            several seeds, for a program

Each policy walks under one condition after another, from the same random states: friction, mass, delay, all three
at once, weak motors, slopes, rough ground, curbs, a push. Runs that differ by their seed only share a table. What a
policy keeps counts against its own speed on level ground. Numbers and conditions: docs/ground.md.")]
pub struct RobustnessArgs {
    /// Run directories of trained policies
    #[arg(required = true, value_name = "RUN")]
    pub runs: Vec<PathBuf>,
    /// Episodes under each condition
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub episodes: Option<usize>,
    /// Seed of the random starts
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub seed: Option<u64>,
    #[command(flatten)]
    pub workers: WorkerThreads,
    /// Print JSON instead of tables
    #[arg(long)]
    pub json: bool,
}

#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  canter report runs/doggo-1-1                     into the run directory itself
  canter report runs/doggo-* --out several-seeds   several trainings on one page
  canter report docs/results                       a folder with compare.json or sweep.json

It leaves report.html, which needs no other file and no network, figures/*.svg and tables/*.csv. Figures as PNG files
need a build with the feature `png`: cargo build --release --package canter --features png.")]
pub struct ReportArgs {
    /// Run directories that are finished, or one folder with `compare.json` or `sweep.json`
    #[arg(required = true, value_name = "RUN")]
    pub folders: Vec<PathBuf>,
    /// Folder for the report; the run directory itself if one run is given without it
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
}

#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  canter serve                                     the runs in runs/, at http://127.0.0.1:8317/
  canter serve experiments --port 0                other runs, at any free port
  canter serve runs/doggo-1-1                      one run

The page lists runs, draws their curves while they train, holds verdicts side by side and shows
the robot in 3D, the learned gait beside the default ones. It reads the runs' files and changes
none. Pages from elsewhere and other machines are refused; other users of this machine are not.
To see a training on another machine: ssh -L 8317:127.0.0.1:8317 THAT_MACHINE, and canter serve
there.")]
pub struct ServeArgs {
    /// The folder that holds the runs, up to six folders deep; `runs`, which is made, if not given
    #[arg(value_name = "RUNS")]
    pub folder: Option<PathBuf>,
    /// The port; 0 for any free one
    #[arg(long, value_name = "PORT", default_value_t = 8317)]
    pub port: u16,
    /// The address to listen at; 0.0.0.0 lets every machine of your network read the runs
    #[arg(long, value_name = "ADDRESS", default_value_t = IpAddr::V4(Ipv4Addr::LOCALHOST))]
    pub host: IpAddr,
}

#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  canter film runs/doggo-1-1                       5 s as RUN/film.gif
  canter film runs/doggo-1-1 --slope 5             five degrees uphill
  canter film runs/doggo-1-1 --out doggo.mp4 --fps 50 --size 1920x720

Both gaits walk the evaluation's first episode, from the same start and at the same clock. Speed
and way count from the start.

Drawing needs neither screen nor graphics card, but OpenGL: EGL or OSMesa; MUJOCO_GL=egl or osmesa
takes that one. A .gif file needs nothing else, an .mp4 file the program ffmpeg.")]
pub struct FilmArgs {
    /// The run directory of a trained policy
    pub run: PathBuf,
    /// The film, .gif or .mp4; `RUN/film.gif` if not given
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Length of the film in seconds, 0.1 to 60
    #[arg(long, value_name = "S", default_value = "5", value_parser = film_seconds, allow_negative_numbers = true)]
    pub seconds: f64,
    /// Slope of the ground in degrees, positive uphill; the run's own if not given
    #[arg(long, value_name = "DEG", allow_negative_numbers = true)]
    pub slope: Option<f64>,
    /// Width and height in pixels, two even numbers: 320x120 to 3840x2160
    #[arg(long, value_name = "WxH", default_value = "960x360", value_parser = film_size)]
    pub size: [u32; 2],
    /// Pictures each second
    #[arg(long, value_name = "N", default_value = "25", value_parser = clap::value_parser!(u32).range(1..=50))]
    pub fps: u32,
}

#[derive(Debug, Args)]
#[command(after_help = "\
The viewer is in builds with the feature `view`:
  cargo build --release --package canter --features view

It shows the evaluation's first episode at the clock of a real robot, over and over, until its
window is closed. A slope looks level: the simulator tilts gravity, not the ground. The keys [ and ]
change to the cameras of the robot's model, which may follow it; Control + Q closes the window.")]
pub struct ViewArgs {
    /// The run directory of a trained policy
    pub run: PathBuf,
    /// Slope of the ground in degrees, positive uphill; the run's own if not given
    #[arg(long, value_name = "DEG", allow_negative_numbers = true)]
    pub slope: Option<f64>,
}

/// The length of a film [s].
fn film_seconds(text: &str) -> Result<f64, String> {
    let seconds = text.parse().ok().filter(|seconds| (0.1..=60.0).contains(seconds));
    seconds.ok_or_else(|| "expected a number from 0.1 to 60".to_owned())
}

/// Width and height of a film in pixels.
fn film_size(text: &str) -> Result<[u32; 2], String> {
    let numbers = text.split_once('x').and_then(|(width, height)| Some([width.parse().ok()?, height.parse().ok()?]));
    let is_possible = |[width, height]: &[u32; 2]| {
        (320..=3840).contains(width) && (120..=2160).contains(height) && width % 2 == 0 && height % 2 == 0
    };
    numbers.filter(is_possible).ok_or_else(|| {
        "expected two even numbers with an x between them, from 320x120 to 3840x2160, for example 960x360".to_owned()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_film_has_a_size_that_video_can_have() {
        assert_eq!(film_size("960x360"), Ok([960, 360]));
        for wrong in ["960", "960x", "x360", "961x360", "960x361", "318x120", "3842x2160", "960x-360", "960 x 360"] {
            assert!(film_size(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn a_film_has_a_length() {
        assert_eq!(film_seconds("2.5"), Ok(2.5));
        for wrong in ["0", "-1", "61", "NaN", "inf", "long"] {
            assert!(film_seconds(wrong).is_err(), "{wrong}");
        }
    }
}
