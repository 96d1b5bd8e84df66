//! Films: what each picture shows, and files that hold the pictures.
//!
//! Tests that draw are ignored by plain `cargo test`: they need OpenGL and ffmpeg. `cargo xtask test --full` runs them.

mod common;

use std::fs;
use std::path::Path;
use std::process::Command;

use canter_sim::Accident;
use canter_sim::render::{Panel, Renderer};
use canter_train::config::Resolved;
use canter_train::evaluate::Mover;
use canter_train::film::take::{Clock, Take, shoot};
use canter_train::film::{FilmError, FilmSettings, Format, film};
use canter_train::trajectory::record;
use common::{TemporaryFolder, names};

const SIZE: [u32; 2] = [320, 120];
const SETTINGS: FilmSettings = FilmSettings { clock: Clock { length_s: 0.8, frames_per_s: 10 }, size: SIZE };

/// The default gait, filmed by this clock.
fn take(changes: &[(&str, &str)], clock: Clock) -> (Resolved, Take) {
    let resolved = common::tiny(changes);
    let take = shoot(&resolved.task, Mover::Prior, &resolved.config.evaluation, clock, "sine (prior)").unwrap();
    (resolved, take)
}

#[test]
fn pictures_are_those_of_the_evaluation_at_the_films_clock() {
    let clock = Clock { length_s: 1.0, frames_per_s: 30 };
    let (resolved, take) = take(&[], clock);
    let steps = record(&resolved.task, Mover::Prior, &resolved.config.evaluation, "sine", "sine").steps;
    assert_eq!(take.shots.len(), 30);
    // A thirtieth of a second is 3.33 steps of 10 ms; there is no picture before the first step.
    for (number, step) in [(0, 1), (1, 3), (2, 7), (3, 10), (29, 97)] {
        let shot = &take.shots[number];
        assert!((shot.time_s - 0.01 * f64::from(step)).abs() < 1e-9, "{shot:?}");
        assert!((shot.distance_m - steps.position_m[step as usize - 1][0].0).abs() < 1e-4, "{shot:?}");
    }
    assert_eq!((take.accident, take.slope_deg, take.label.as_str()), (None, 0.0, "sine (prior)"));
}

#[test]
fn the_camera_follows_without_shaking() {
    let (_, take) = take(&[], Clock { length_s: 2.0, frames_per_s: 50 });
    let changes = |values: Vec<f64>| -> f64 { values.windows(3).map(|v| (v[2] - 2.0 * v[1] + v[0]).abs()).sum() };
    let target = take.shots.iter().map(|shot| shot.target_m[0]).collect();
    let robot = take.shots.iter().map(|shot| shot.distance_m).collect();
    assert!(changes(target) < 0.5 * changes(robot));
    for shot in &take.shots {
        assert!((shot.target_m[0] - shot.distance_m).abs() < 0.1, "{shot:?}");
    }
}

#[test]
fn after_an_accident_the_robot_stays_and_the_clock_goes_on() {
    let clock = Clock { length_s: 2.0, frames_per_s: 10 };
    let (_, take) = take(&[("task.slope_deg", "20")], clock);
    let (accident, time_s) = take.accident.unwrap();
    assert!(accident == Accident::Rollover && time_s < 1.8 && take.slope_deg == 20.0, "{accident:?} {time_s}");
    let [.., before, last] = take.shots.as_slice() else { panic!("too few") };
    assert_eq!((&before.pose, before.distance_m), (&last.pose, last.distance_m));
    assert!((last.time_s - 1.9).abs() < 1e-9);
}

#[test]
fn the_ending_of_the_name_decides() {
    assert_eq!(Format::of(Path::new("a/film.gif")).unwrap(), Format::Gif);
    assert_eq!(Format::of(Path::new("film.MP4")).unwrap(), Format::Mp4);
    for wrong in ["film", "film.avi", ".gif"] {
        assert!(matches!(Format::of(Path::new(wrong)), Err(FilmError::UnknownEnding(_))), "{wrong}");
    }
}

#[test]
#[ignore = "needs OpenGL: cargo xtask test --full"]
fn pictures_change_as_the_robot_moves_and_the_ground_tilts() {
    let (resolved, take) = take(&[], SETTINGS.clock);
    let draw = |slope_rad: f64, number: usize| {
        let mut renderer = Renderer::new(&resolved.task.robot, SIZE, slope_rad).unwrap();
        let shot = &take.shots[number];
        let panel = Panel { pose: &shot.pose, target: shot.target_m, title: "", subtitle: "", footer: "" };
        renderer.draw(&[panel.clone(), panel]).to_vec()
    };
    let picture = draw(0.0, 0);
    assert_eq!(picture.len(), 3 * 320 * 120);
    // Both panels show the same, but for rounding at edges, with the gap between them.
    let mut differing_at_edges = 0;
    for row in picture.chunks_exact(3 * 320) {
        differing_at_edges += row[..3 * 159].iter().zip(&row[3 * 161..]).filter(|(a, b)| a != b).count();
        assert_eq!(row[3 * 159..3 * 161], [255; 6]);
    }
    assert!(differing_at_edges < 500, "{differing_at_edges}");
    // Most of Doggo is darker than anything else, and its deck is red.
    let count = |is_so: fn(&[u8]) -> bool| picture.chunks_exact(3).filter(|pixel| is_so(pixel)).count();
    assert!(count(|pixel| pixel.iter().all(|&value| value < 60)) > 500);
    assert!(count(|pixel| pixel[0] > 100 && pixel[1] < 60 && pixel[2] < 60) > 200);
    let differing = |other: &[u8]| picture.iter().zip(other).filter(|(a, b)| a != b).count();
    assert_eq!(differing(&draw(0.0, 0)), 0);
    assert!(differing(&draw(0.0, 4)) > 1000);
    assert!(differing(&draw(0.2, 0)) > 10_000);
}

#[test]
#[ignore = "needs OpenGL: cargo xtask test --full"]
fn renderers_of_one_thread_do_not_draw_into_each_other() {
    let (resolved, take) = take(&[], SETTINGS.clock);
    let shot = &take.shots[0];
    let panel = [Panel { pose: &shot.pose, target: shot.target_m, title: "", subtitle: "", footer: "" }];
    let new = |slope_rad| Renderer::new(&resolved.task.robot, SIZE, slope_rad).unwrap();
    let (mut level, mut tilted) = (new(0.0), new(0.2));
    let first = level.draw(&panel).to_vec();
    let other = tilted.draw(&panel).to_vec();
    assert!(level.draw(&panel) == first && other != first);
    drop(tilted);
    assert!(level.draw(&panel) == first);
}

/// Writes the film of two gaits, or gives it up after some pictures.
fn write(path: &Path, pictures: usize) -> Result<bool, FilmError> {
    let (resolved, prior) = take(&[], SETTINGS.clock);
    let action = vec![1.0; resolved.task.num_actions()];
    let mover = Mover::Constant(&action);
    let other = shoot(&resolved.task, mover, &resolved.config.evaluation, SETTINGS.clock, "other").unwrap();
    let mut told = Vec::new();
    let finished = film(path, &resolved.task.robot, &[prior, other], &SETTINGS, &mut |count| {
        told.push(count);
        count < pictures
    });
    assert_eq!(told, (1..=pictures.min(8)).collect::<Vec<_>>());
    finished
}

#[test]
#[ignore = "needs OpenGL: cargo xtask test --full"]
fn a_gif_holds_every_picture() {
    let folder = TemporaryFolder::new();
    let path = folder.join("film.gif");
    assert!(write(&path, usize::MAX).is_ok_and(|finished| finished));
    assert_eq!(names(folder.path()), ["film.gif"]);
    let mut decoder = gif::DecodeOptions::new().read_info(fs::File::open(&path).unwrap()).unwrap();
    assert_eq!([decoder.width(), decoder.height()], [320, 120]);
    let (mut delays, mut changed) = (Vec::new(), Vec::new());
    while let Some(frame) = decoder.read_next_frame().unwrap() {
        delays.push(frame.delay);
        changed.push(frame.buffer.iter().filter(|&&entry| Some(entry) != frame.transparent).count());
    }
    assert_eq!(delays, [10; 8]);
    assert_eq!(changed[0], 320 * 120);
    for count in &changed[1..] {
        assert!((300..320 * 120).contains(count), "{changed:?}");
    }
}

#[test]
#[ignore = "needs OpenGL and ffmpeg: cargo xtask test --full"]
fn an_mp4_holds_every_picture() {
    let folder = TemporaryFolder::new();
    let path = folder.join("film.mp4");
    assert!(write(&path, usize::MAX).is_ok_and(|finished| finished));
    assert_eq!(names(folder.path()), ["film.mp4"]);
    let mut probe = Command::new("ffprobe");
    probe.args(["-v", "error", "-count_frames", "-of", "csv=p=0"]);
    probe.args(["-show_entries", "stream=width,height,nb_read_frames"]).arg(&path);
    let output = probe.output().expect("ffprobe, which comes with ffmpeg (Debian, Ubuntu: `apt install ffmpeg`)");
    assert_eq!(String::from_utf8(output.stdout).unwrap().trim(), "320,120,8");
}

#[test]
#[ignore = "needs OpenGL and ffmpeg: cargo xtask test --full"]
fn a_film_that_is_given_up_leaves_nothing_and_touches_nothing() {
    let folder = TemporaryFolder::new();
    for name in ["film.gif", "film.mp4"] {
        let path = folder.join(name);
        assert!(write(&path, 3).is_ok_and(|finished| !finished));
        assert_eq!(names(folder.path()), Vec::<String>::new());
        fs::write(&path, "an earlier film").unwrap();
        assert!(write(&path, 3).is_ok_and(|finished| !finished));
        assert_eq!(fs::read_to_string(&path).unwrap(), "an earlier film");
        fs::remove_file(&path).unwrap();
    }
}
