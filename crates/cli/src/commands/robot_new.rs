//! `canter robot new`.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use canter_sim::Robot;
use canter_sim::mujoco::convert::urdf_to_mjcf;
use canter_sim::robot::draft::{Draft, Names, Note, draft, header, robot_name, urdf};
use canter_sim::robot::{GaitSettings, SteppingSettings, load_model};
use canter_sim::settings::write_commented;
use canter_train::config::resolve;
use canter_train::evaluate::{Mover, evaluate};

use crate::args::RobotNewArgs;
use crate::commands::{bare_gait, workers};
use crate::error::CliError;
use crate::output::{program, say};

/// `canter robot new`.
pub fn robot_new(args: &RobotNewArgs) -> Result<ExitCode, CliError> {
    let (_, files) = load_model(&args.from)?;
    let stem = args.from.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let name = args.name.clone().unwrap_or_else(|| robot_name(&stem));
    let scene = format!("{stem}_scene.xml");
    let is_urdf = args.from.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("urdf"));
    let file_name = if is_urdf {
        format!("{stem}.xml")
    } else {
        args.from.file_name().unwrap_or_default().to_string_lossy().into_owned()
    };

    let model_folder = args.from.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let folder = args.out.clone().unwrap_or_else(|| model_folder.to_owned());
    let (robot_file, scene_file, model_file) =
        (folder.join("robot.toml"), folder.join(&scene), folder.join(&file_name));
    let made = [Some(&robot_file), Some(&scene_file), is_urdf.then_some(&model_file)];
    if let Some(path) = made.into_iter().flatten().find(|path| path.exists()) {
        return Err(CliError::Exists(path.display().to_string()));
    }
    // Before anything is written: a model that is no robot leaves nothing behind. A URDF is none before it is an MJCF.
    let names = Names { robot: &name, model: &file_name, scene: &scene };
    let first = if is_urdf { None } else { Some(draft_of(&args.from, names)?) };
    if !is_same(&folder, model_folder) {
        copy(&files, model_folder, &folder)?;
    }
    if is_urdf {
        convert(&args.from, &model_file)?;
    }
    let mut drafted = first.map_or_else(|| draft_of(&model_file, names), Ok)?;
    let mut written = vec![robot_file.clone()];
    if is_urdf {
        written.push(model_file);
    }
    if let Some(text) = &drafted.scene {
        write(&scene_file, text)?;
        written.push(scene_file);
    }
    write_robot(&robot_file, &drafted)?;
    // What is drafted has to load; what does not is for its owner to see now.
    let path = robot_file.display().to_string();
    let loaded = Robot::load(&path).map(|_| ());
    if loaded.is_ok() {
        make_walk(&path, &mut drafted, args.workers.threads)?;
        write_robot(&robot_file, &drafted)?;
    }

    say(&format!("{}\n", drafted.settings.description));
    for leg in &drafted.settings.legs {
        say(&format!("  leg {}", leg.name()));
    }
    for held in drafted.settings.held.iter().flatten() {
        say(&format!("  held still: {}", held.joint));
    }
    say("\nTo look through, because the model does not say it:");
    for note in &drafted.notes {
        say(&format!("  {}: {}", note.key, note.message));
    }
    say("");
    for path in &written {
        say(&format!("Wrote:    {}", path.display()));
    }
    loaded.map_err(|error| CliError::Drafted(format!("the draft needs your hand before it can be used:\n{error}")))?;
    say(&format!("Next:     {} robot check {path}", program()));
    Ok(ExitCode::SUCCESS)
}

fn draft_of(path: &Path, names: Names<'_>) -> Result<Draft, CliError> {
    let (mut model, _) = load_model(path)?;
    Ok(draft(&mut model, names)?)
}

/// Makes an MJCF of a URDF: its trunk floats, every hinge has a motor.
fn convert(urdf_file: &Path, mjcf_file: &Path) -> Result<(), CliError> {
    let wrong = |message: String| CliError::Drafted(format!("{}: {message}", urdf_file.display()));
    let bytes = fs::read(urdf_file).map_err(|error| CliError::File(urdf_file.display().to_string(), error))?;
    let afloat = urdf::afloat(&String::from_utf8_lossy(&bytes)).map_err(wrong)?;
    // Beside the copy of the meshes.
    let temporary = mjcf_file.with_extension(format!("{}.urdf", std::process::id()));
    write(&temporary, &afloat)?;
    // What is new in it is tried in a process with limits, too.
    let tried = load_model(&temporary).map_err(CliError::from);
    let converted = tried.and_then(|_| urdf_to_mjcf(&temporary).map_err(wrong));
    let removed = fs::remove_file(&temporary).map_err(|error| CliError::File(temporary.display().to_string(), error));
    let mjcf = urdf::with_motors(&converted?).map_err(wrong)?;
    removed?;
    write(mjcf_file, &mjcf)
}

/// Shares of the similar gait's lengths and multiples of its frequency that are tried until one stays on its feet.
const GENTLER: [[f64; 2]; 6] = [[1.0, 1.0], [0.7, 1.2], [0.5, 1.5], [0.35, 1.7], [0.35, 2.0], [0.25, 2.5]];

/// Episodes in which a gait must not fall.
const NUM_EPISODES: u32 = 8;

/// Makes the default gait gentler until it does not fall; says so if it had to, or if none does.
fn make_walk(path: &str, drafted: &mut Draft, threads: Option<u16>) -> Result<(), CliError> {
    let Some(GaitSettings::Stepping(similar)) = drafted.settings.gaits.first().cloned() else { return Ok(()) };
    for [length, frequency] in GENTLER {
        let rounded = |value: f64, digits: i32| (value * 10_f64.powi(digits)).round() / 10_f64.powi(digits);
        let tried = SteppingSettings {
            stride_frequency_hz: rounded(similar.stride_frequency_hz * frequency, 2),
            down_amplitude_m: rounded(similar.down_amplitude_m * length, 4),
            up_amplitude_m: rounded(similar.up_amplitude_m * length, 4),
            step_length_m: rounded(similar.step_length_m * length, 4),
            ..similar.clone()
        };
        drafted.settings.gaits[0] = GaitSettings::Stepping(tried.clone());
        write_robot(Path::new(path), drafted)?;
        let mut document = bare_gait(path, &tried.name)?;
        document.set("evaluation.num_episodes", &NUM_EPISODES.to_string());
        // A leg that cannot reach so far.
        let Ok(resolved) = resolve(&document) else { continue };
        let report = evaluate(&resolved.task, Mover::Prior, &resolved.config.evaluation, &workers(threads)?);
        if report.falls == 0 && report.speed_m_per_s > 0.0 {
            if length < 1.0 {
                let message = format!(
                    "`{}` in the robot's own size falls; with {length} times its lengths and {frequency} times its \
                     frequency it does not, at {:.2} m/s",
                    tried.name, report.speed_m_per_s
                );
                drafted.notes.push(Note { key: "gaits", message });
            }
            return Ok(());
        }
    }
    let message = format!("`{}` falls in every form that was tried: it needs your hand", similar.name);
    drafted.notes.push(Note { key: "gaits", message });
    let stable = SteppingSettings { stable: false, ..similar };
    drafted.settings.gaits[0] = GaitSettings::Stepping(stable);
    Ok(())
}

fn write_robot(path: &Path, drafted: &Draft) -> Result<(), CliError> {
    write(path, &format!("{}{}", header(drafted), write_commented(&drafted.settings)))
}

fn is_same(a: &Path, b: &Path) -> bool {
    matches!((a.canonicalize(), b.canonicalize()), (Ok(a), Ok(b)) if a == b)
}

/// Copies the model's files, each to its place from the model's folder.
fn copy(files: &[PathBuf], from: &Path, to: &Path) -> Result<(), CliError> {
    fn failed(path: &Path) -> impl FnOnce(std::io::Error) -> CliError + use<> {
        let path = path.display().to_string();
        move |error| CliError::File(path, error)
    }
    let root = from.canonicalize().map_err(failed(from))?;
    for file in files {
        let real = file.canonicalize().map_err(failed(file))?;
        let target = to.join(file.strip_prefix(&root).or_else(|_| real.strip_prefix(&root)).unwrap_or(file));
        if target.exists() {
            return Err(CliError::Exists(target.display().to_string()));
        }
        let folder = target.parent().unwrap_or(to);
        fs::create_dir_all(folder).map_err(failed(folder))?;
        fs::copy(file, &target).map_err(failed(&target))?;
    }
    Ok(())
}

/// Writes a file whole or not at all.
fn write(path: &Path, text: &str) -> Result<(), CliError> {
    let failed = |error| CliError::File(path.display().to_string(), error);
    let temporary = path.with_extension(format!("writing-{}", std::process::id()));
    fs::write(&temporary, text).and_then(|()| fs::rename(&temporary, path)).map_err(failed)
}
