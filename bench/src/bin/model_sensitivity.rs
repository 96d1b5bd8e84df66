//! How much the speed of Doggo's gaits depends on each number of its model that no source gives exactly.
//!
//! Every number is moved by -50 % and +50 % alone, and each gait is measured with the `doggo` preset's evaluation
//! protocol. The tables that this prints stand in `docs/doggo-model.md`.
//!
//! ```sh
//! cargo run --release -p canter-bench --bin model_sensitivity
//! ```

use std::error::Error;
use std::sync::Arc;

use canter_sim::frame::{self, Matrix3};
use canter_sim::mujoco::{Model, ObjectKind, Simulation};
use canter_sim::{Env, Robot, Task};
use canter_train::config::{EvaluationSettings, open_preset, resolve};
use canter_train::evaluate::{Episode, Mover, evaluate, run_episodes};
use canter_train::executor::Workers;
use canter_train::statistics::{bootstrap_interval, mean, population_std, quantile};

const GAITS: [&str; 3] = ["stepping", "sine", "sine-literal"];

const LEGS: [&str; 4] = ["front_left", "back_left", "back_right", "front_right"];

/// Length of the episodes that show how far a gait turns [s].
const HEADING_EPISODE_S: f64 = 5.0;

/// A number of the model that is moved alone.
struct Quantity {
    name: &'static str,
    unit: &'static str,
    get: fn(&Robot) -> f64,
    set: fn(&mut Robot, f64),
    /// What it is multiplied with.
    factors: [f64; 2],
}

/// -50 % and +50 %.
const HALF_AND_HALF_MORE: [f64; 2] = [0.5, 1.5];

/// The chassis' width is known, so the track width is known to about this.
const A_TENTH: [f64; 2] = [0.9, 1.1];

/// A delay is a whole number of control steps: 0 and 2 instead of 1.
const NONE_AND_TWICE: [f64; 2] = [0.0, 2.0];

#[rustfmt::skip]
const QUANTITIES: [Quantity; 15] = [
    Quantity { name: "hip armature", unit: "kg m^2", get: hip_armature, set: set_hip_armature, factors: HALF_AND_HALF_MORE },
    Quantity { name: "hip damping", unit: "N m s/rad", get: hip_damping, set: set_hip_damping, factors: HALF_AND_HALF_MORE },
    Quantity { name: "hip frictionloss", unit: "N m", get: hip_friction, set: set_hip_friction, factors: HALF_AND_HALF_MORE },
    Quantity { name: "knee damping", unit: "N m s/rad", get: knee_damping, set: set_knee_damping, factors: HALF_AND_HALF_MORE },
    Quantity { name: "upper link with knee joint", unit: "kg", get: upper_mass, set: set_upper_mass, factors: HALF_AND_HALF_MORE },
    Quantity { name: "lower link with half a foot", unit: "kg", get: lower_mass, set: set_lower_mass, factors: HALF_AND_HALF_MORE },
    Quantity { name: "chassis inertia, here about y", unit: "kg m^2", get: chassis_inertia, set: set_chassis_inertia, factors: HALF_AND_HALF_MORE },
    Quantity { name: "hip y", unit: "m", get: hip_y, set: set_hip_y, factors: HALF_AND_HALF_MORE },
    Quantity { name: "hip y, -10 % and +10 %", unit: "m", get: hip_y, set: set_hip_y, factors: A_TENTH },
    Quantity { name: "foot radius", unit: "m", get: foot_radius, set: set_foot_radius, factors: HALF_AND_HALF_MORE },
    Quantity { name: "sliding friction", unit: "-", get: friction, set: set_friction, factors: HALF_AND_HALF_MORE },
    Quantity { name: "contact `solref` time", unit: "s", get: contact_time, set: set_contact_time, factors: HALF_AND_HALF_MORE },
    Quantity { name: "`impratio`", unit: "-", get: impratio, set: set_impratio, factors: HALF_AND_HALF_MORE },
    Quantity { name: "torque limit", unit: "N m", get: torque_limit, set: set_torque_limit, factors: HALF_AND_HALF_MORE },
    Quantity { name: "command delay, 0 and 2", unit: "control step", get: delay, set: set_delay, factors: NONE_AND_TWICE },
];

fn main() -> Result<(), Box<dyn Error>> {
    let resolved = resolve(&open_preset("doggo")?)?;
    let settings = &resolved.config.evaluation;
    let workers = Workers::new(None)?;
    let tasks: Vec<Task> = GAITS.iter().map(|name| resolved.task.with_gait(name).expect("a gait of doggo")).collect();

    print_as_it_is(&tasks, settings, &workers);
    println!("\n| quantity | value | {} |", GAITS.map(|gait| format!("{gait} -50 % | {gait} +50 %")).join(" | "));
    println!("| --- | --- |{}", " --- |".repeat(2 * GAITS.len()));
    for quantity in &QUANTITIES {
        let value = (quantity.get)(&resolved.task.robot);
        let moved = quantity.factors.map(|factor| Arc::new(moved_robot(&resolved.task.robot, quantity, factor)));
        let cells: Vec<String> = tasks
            .iter()
            .flat_map(|task| moved.iter().map(move |robot| on_robot(task, robot.clone())))
            .map(|task| cell(&run_episodes(&task, edited_env, Mover::Prior, settings, &workers)))
            .collect();
        println!("| {} | {} {} | {} |", quantity.name, three_digits(value), quantity.unit, cells.join(" | "));
    }
    Ok(())
}

/// Speed, falls and heading of each gait on the model as it is.
fn print_as_it_is(tasks: &[Task], settings: &EvaluationSettings, workers: &Workers) {
    println!(
        "| gait | speed [m/s] | its std | displacement speed [m/s] | falls | heading after {HEADING_EPISODE_S} s, median [deg] | largest [deg] |"
    );
    println!("| --- | --- | --- | --- | --- | --- | --- |");
    for (name, task) in GAITS.iter().zip(tasks) {
        let episodes = run_episodes(task, edited_env, Mover::Prior, settings, workers);
        let published = evaluate(task, Mover::Prior, settings, workers);
        let recomputed: Vec<f64> = episodes.iter().map(|episode| episode.speed_m_per_s).collect();
        assert_eq!(recomputed, published.speeds_m_per_s, "recomputing an unchanged model's constants changes nothing");
        let short = EvaluationSettings { episode_s: HEADING_EPISODE_S, ..settings.clone() };
        let mut headings: Vec<f64> = run_episodes(task, edited_env, Mover::Prior, &short, workers)
            .iter()
            .map(|episode| episode.heading_deg)
            .collect();
        headings.sort_by(f64::total_cmp);
        let (median, largest) = (quantile(&headings, 0.5), quantile(&headings, 1.0));
        println!(
            "| {name} | {} | {:.3} | {:.3} | {} of {} | {median:.1} | {largest:.1} |",
            speed(&episodes),
            population_std(&recomputed),
            published.displacement_speed_m_per_s,
            falls(&episodes),
            episodes.len()
        );
    }
}

/// Mean speed with its interval, and the falls, if any.
fn cell(episodes: &[Episode]) -> String {
    match falls(episodes) {
        0 => speed(episodes),
        falls => format!("{}, {falls} of {} fell", speed(episodes), episodes.len()),
    }
}

/// A number with three significant digits, without zeros at its end.
fn three_digits(value: f64) -> String {
    let decimals = (2.0 - value.abs().log10().floor()).max(1.0) as usize;
    format!("{value:.decimals$}").trim_end_matches('0').trim_end_matches('.').to_owned()
}

fn falls(episodes: &[Episode]) -> usize {
    episodes.iter().filter(|episode| episode.accident.is_some()).count()
}

/// Mean speed with its 95 % bootstrap interval over the starts [m/s].
fn speed(episodes: &[Episode]) -> String {
    let speeds: Vec<f64> = episodes.iter().map(|episode| episode.speed_m_per_s).collect();
    let [low, high] = bootstrap_interval(&[&speeds], |groups| mean(&groups[0]));
    format!("{:.3} [{low:.3}, {high:.3}]", mean(&speeds))
}

/// The robot with one number multiplied by `factor`; the total mass never changes.
fn moved_robot(robot: &Robot, quantity: &Quantity, factor: f64) -> Robot {
    let mut moved = robot.clone();
    let value = factor * (quantity.get)(robot);
    (quantity.set)(&mut moved, value);
    let close = |a: f64, b: f64| (a - b).abs() < 1e-9;
    assert!(close((quantity.get)(&moved), value), "{} was set to {value}", quantity.name);
    assert!(close(moved.model.total_mass_kg(), robot.model.total_mass_kg()), "{}: the total mass", quantity.name);
    moved
}

fn on_robot(task: &Task, robot: Arc<Robot>) -> Task {
    let mut task = task.clone();
    task.robot = robot;
    task
}

/// An environment on a model that was edited after it was compiled.
fn edited_env(task: Arc<Task>) -> Env {
    assert!(
        task.settings.slope_deg == 0.0 && task.settings.friction.is_none(),
        "flat ground, the model's own friction"
    );
    let mut model = task.robot.model.clone();
    model.set_timestep_s(task.settings.physics_dt_s);
    let mut simulation = Simulation::new(&model);
    simulation.update_constants();
    Env::with_simulation(task, simulation)
}

/// The number of an object that the model has.
fn id(model: &Model, kind: ObjectKind, name: &str) -> usize {
    model.id(kind, name).unwrap_or_else(|| panic!("doggo.xml has no {kind:?} `{name}`"))
}

/// The objects of all legs, two each: `<leg>_<part>_a` and `<leg>_<part>_b`.
fn of_legs(model: &Model, kind: ObjectKind, part: &str) -> Vec<usize> {
    let names = LEGS.iter().flat_map(|leg| ["a", "b"].map(|link| format!("{leg}_{part}_{link}")));
    names.map(|name| id(model, kind, &name)).collect()
}

/// The degrees of freedom of all joints `<leg>_<part>_a` and `_b`.
fn dofs(model: &Model, part: &str) -> Vec<usize> {
    let joints = of_legs(model, ObjectKind::Joint, part);
    joints.into_iter().map(|joint| model.joint_addresses(joint).1).collect()
}

fn hip_armature(robot: &Robot) -> f64 {
    robot.model.raw().dof_armature()[dofs(&robot.model, "motor")[0]]
}

fn set_hip_armature(robot: &mut Robot, value: f64) {
    for dof in dofs(&robot.model, "motor") {
        robot.model.raw_mut().dof_armature_mut()[dof] = value;
    }
}

fn hip_damping(robot: &Robot) -> f64 {
    robot.model.raw().dof_damping()[dofs(&robot.model, "motor")[0]]
}

fn set_hip_damping(robot: &mut Robot, value: f64) {
    for dof in dofs(&robot.model, "motor") {
        robot.model.raw_mut().dof_damping_mut()[dof] = value;
    }
}

fn hip_friction(robot: &Robot) -> f64 {
    robot.model.raw().dof_frictionloss()[dofs(&robot.model, "motor")[0]]
}

fn set_hip_friction(robot: &mut Robot, value: f64) {
    for dof in dofs(&robot.model, "motor") {
        robot.model.raw_mut().dof_frictionloss_mut()[dof] = value;
    }
}

fn knee_damping(robot: &Robot) -> f64 {
    robot.model.raw().dof_damping()[dofs(&robot.model, "knee")[0]]
}

fn set_knee_damping(robot: &mut Robot, value: f64) {
    for dof in dofs(&robot.model, "knee") {
        robot.model.raw_mut().dof_damping_mut()[dof] = value;
    }
}

fn upper_mass(robot: &Robot) -> f64 {
    link_mass(robot, "upper")
}

fn set_upper_mass(robot: &mut Robot, value: f64) {
    set_link_mass(robot, "upper", value);
}

fn lower_mass(robot: &Robot) -> f64 {
    link_mass(robot, "lower")
}

fn set_lower_mass(robot: &mut Robot, value: f64) {
    set_link_mass(robot, "lower", value);
}

fn link_mass(robot: &Robot, part: &str) -> f64 {
    robot.model.raw().body_mass()[of_legs(&robot.model, ObjectKind::Body, part)[0]]
}

/// Sets mass and, in proportion, inertia of eight links; the chassis' frame takes up the difference.
fn set_link_mass(robot: &mut Robot, part: &str, value: f64) {
    let factor = value / link_mass(robot, part);
    let total_kg = robot.model.total_mass_kg();
    for body in of_legs(&robot.model, ObjectKind::Body, part) {
        let model = robot.model.raw_mut();
        model.body_mass_mut()[body] = value;
        model.body_inertia_mut()[body] = model.body_inertia()[body].map(|moment| factor * moment);
    }
    let missing_kg = total_kg - robot.model.total_mass_kg();
    add_to_frame(&mut robot.model, missing_kg);
}

/// Adds mass to the chassis' frame, a uniform box about the chassis' origin.
fn add_to_frame(model: &mut Model, mass_kg: f64) {
    let (body, geom) = (id(model, ObjectKind::Body, "chassis"), id(model, ObjectKind::Geom, "chassis"));
    let raw = model.raw_mut();
    let [x, y, z] = raw.geom_size()[geom].map(|half_extent| half_extent * half_extent);
    let box_inertia = diagonal([y + z, x + z, x + y].map(|square| mass_kg * square / 3.0));
    let (old_kg, centre) = (raw.body_mass()[body], raw.body_ipos()[body]);
    let body_from_principal = frame::from_quaternion(raw.body_iquat()[body]);
    let principal_from_body = transposed(&body_from_principal);
    let principal = diagonal(raw.body_inertia()[body]);
    let own_inertia = frame::multiply(&frame::multiply(&body_from_principal, &principal), &principal_from_body);

    let new_kg = old_kg + mass_kg;
    let new_centre = centre.map(|coordinate| coordinate * old_kg / new_kg);
    // About the chassis' origin masses simply add up.
    let about_origin = sum(&[own_inertia, point_inertia(old_kg, centre), box_inertia]);
    let about_centre = sum(&[about_origin, point_inertia(-new_kg, new_centre)]);
    // Both parts are symmetric about the same planes, so the principal axes stay.
    let principal = frame::multiply(&frame::multiply(&principal_from_body, &about_centre), &body_from_principal);
    raw.body_mass_mut()[body] = new_kg;
    raw.body_ipos_mut()[body] = new_centre;
    raw.body_inertia_mut()[body] = [principal[0][0], principal[1][1], principal[2][2]];
}

/// Inertia of a point mass about the origin [kg m^2].
fn point_inertia(mass_kg: f64, [x, y, z]: [f64; 3]) -> Matrix3 {
    [[y * y + z * z, -x * y, -x * z], [-x * y, x * x + z * z, -y * z], [-x * z, -y * z, x * x + y * y]]
        .map(|row| row.map(|value| mass_kg * value))
}

fn diagonal(values: [f64; 3]) -> Matrix3 {
    std::array::from_fn(|i| std::array::from_fn(|j| if i == j { values[i] } else { 0.0 }))
}

fn transposed(matrix: &Matrix3) -> Matrix3 {
    std::array::from_fn(|i| std::array::from_fn(|j| matrix[j][i]))
}

fn sum(matrices: &[Matrix3]) -> Matrix3 {
    std::array::from_fn(|i| std::array::from_fn(|j| matrices.iter().map(|matrix| matrix[i][j]).sum()))
}

/// About y: the middle one of the principal moments, which MuJoCo sorts.
fn chassis_inertia(robot: &Robot) -> f64 {
    robot.model.raw().body_inertia()[id(&robot.model, ObjectKind::Body, "chassis")][1]
}

/// Moves all three moments in proportion.
fn set_chassis_inertia(robot: &mut Robot, value: f64) {
    let factor = value / chassis_inertia(robot);
    let body = id(&robot.model, ObjectKind::Body, "chassis");
    let model = robot.model.raw_mut();
    model.body_inertia_mut()[body] = model.body_inertia()[body].map(|moment| factor * moment);
}

fn hip_y(robot: &Robot) -> f64 {
    robot.model.raw().body_pos()[of_legs(&robot.model, ObjectKind::Body, "upper")[0]][1]
}

fn set_hip_y(robot: &mut Robot, value: f64) {
    for body in of_legs(&robot.model, ObjectKind::Body, "upper") {
        let y = &mut robot.model.raw_mut().body_pos_mut()[body][1];
        *y = value.copysign(*y);
    }
}

fn feet(robot: &Robot) -> Vec<usize> {
    LEGS.iter().map(|leg| id(&robot.model, ObjectKind::Geom, &format!("{leg}_foot"))).collect()
}

fn foot_radius(robot: &Robot) -> f64 {
    robot.model.geom_radius_m(feet(robot)[0])
}

/// An episode's start puts the feet on the ground, so the standing height follows.
fn set_foot_radius(robot: &mut Robot, value: f64) {
    for geom in feet(robot) {
        let model = robot.model.raw_mut();
        model.geom_size_mut()[geom][0] = value;
        model.geom_rbound_mut()[geom] = value;
        model.geom_aabb_mut()[geom] = [0.0, 0.0, 0.0, value, value, value];
    }
}

fn friction(robot: &Robot) -> f64 {
    robot.model.raw().geom_friction()[feet(robot)[0]][0]
}

fn set_friction(robot: &mut Robot, value: f64) {
    robot.model.set_friction(value);
}

fn contact_time(robot: &Robot) -> f64 {
    robot.model.raw().geom_solref()[feet(robot)[0]][0]
}

/// Of every geom; the robot's have priority over the floor's.
fn set_contact_time(robot: &mut Robot, value: f64) {
    for solref in robot.model.raw_mut().geom_solref_mut() {
        solref[0] = value;
    }
}

fn impratio(robot: &Robot) -> f64 {
    robot.model.raw().opt().impratio
}

fn set_impratio(robot: &mut Robot, value: f64) {
    robot.model.raw_mut().opt_mut().impratio = value;
}

fn torque_limit(robot: &Robot) -> f64 {
    robot.settings.motor.max_torque_nm
}

/// The environment passes it on to MuJoCo at every physics step.
fn set_torque_limit(robot: &mut Robot, value: f64) {
    robot.settings.motor.max_torque_nm = value;
}

fn delay(robot: &Robot) -> f64 {
    f64::from(robot.settings.command_delay_steps)
}

fn set_delay(robot: &mut Robot, value: f64) {
    robot.settings.command_delay_steps = value as u32;
}
