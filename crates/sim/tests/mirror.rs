//! What is left and what is right can be exchanged.

mod common;

use canter_gait::Modulation;
use canter_sim::mirror::MirrorMaps;
use canter_sim::settings::Document;
use canter_sim::task::{BlockChoice, ModulationChoice};
use canter_sim::{Env, PolicySettings, Robot, Task};

fn symmetric(modulation: ModulationChoice) -> PolicySettings {
    PolicySettings { symmetric: true, ..common::policy_settings("sine", modulation) }
}

/// Walks from the start that `uniform` gives, under actions that `action` makes of the step's number; the observations.
fn walk(
    task: &std::sync::Arc<Task>,
    mut start: impl FnMut() -> f64,
    action: impl Fn(usize) -> Vec<f32>,
) -> Vec<Vec<f32>> {
    let mut env = Env::new(task.clone());
    let mut observation = vec![0.0; task.num_observations()];
    env.reset(&mut start, &mut observation);
    let mut observations = vec![observation.clone()];
    for step in 0..25 {
        env.step(&action(step), &mut observation);
        observations.push(observation.clone());
    }
    observations
}

/// The physics itself is the judge: the mirrored robot under the mirrored commands sees the mirrored world.
#[test]
fn a_mirrored_robot_under_mirrored_actions_sees_mirrored_observations() {
    for modulation in ModulationChoice::ALL.iter().copied() {
        let mut settings = common::task_settings();
        settings.start_noise_rad = 0.0;
        settings.slope_deg = 5.0;
        let task = common::doggo(&settings, &symmetric(modulation));
        let mirror = task.mirror().unwrap();
        let mut uniform = common::uniform(3);
        let actions: Vec<Vec<f32>> =
            (0..25).map(|_| (0..task.num_actions()).map(|_| (uniform() - 0.5) as f32).collect()).collect();
        // Without noise the first random number, the phase, is all that a start has. In the mirror a trot is half a
        // cycle later.
        let seen = walk(&task, || 0.125, |step| actions[step].clone());
        let mirrored = walk(
            &task,
            || 0.625,
            |step| {
                let mut action = actions[step].clone();
                mirror.reflect_action(&mut action);
                action
            },
        );
        for (step, (seen, mirrored)) in seen.iter().zip(&mirrored).enumerate() {
            let mut image = seen.clone();
            mirror.reflect_observation(&mut image);
            for (expected, found) in image.iter().zip(mirrored) {
                assert!((expected - found).abs() < 2e-3, "{modulation:?}, step {step}: {expected} and {found}");
            }
            // It is no mirror that leaves everything in its place.
            let differs = image.iter().zip(seen).any(|(a, b)| (a - b).abs() > 0.05);
            assert!(differs || step == 0, "{modulation:?}, step {step}");
        }
    }
}

#[test]
fn a_lopsided_gait_or_robot_has_no_mirror_image() {
    let refusal = |change: &dyn Fn(&mut Robot)| {
        let mut robot = Robot::load("doggo").unwrap();
        change(&mut robot);
        let legs = robot.gait("sine").unwrap().legs.clone();
        let phase = [BlockChoice::Phase.block()];
        MirrorMaps::new(&robot, &legs, Modulation::Modulate, &phase).err()
    };
    let shifted = |robot: &mut Robot, offsets: [f32; 4]| {
        for gait in &mut robot.gaits {
            gait.legs.iter_mut().zip(offsets).for_each(|(leg, offset)| leg.phase_offset = offset);
        }
    };
    let no_mirror = Some("in the mirror its gait is not itself half a cycle later".to_owned());
    // Front left, back left, back right, front right: trot and walk; bound; no gait at all.
    assert_eq!(refusal(&|robot| shifted(robot, [0.0, 0.5, 0.0, 0.5])), None);
    assert_eq!(refusal(&|robot| shifted(robot, [0.0, 0.25, 0.75, 0.5])), None);
    assert_eq!(refusal(&|robot| shifted(robot, [0.0, 0.5, 0.5, 0.0])), no_mirror);
    assert_eq!(refusal(&|robot| shifted(robot, [0.3, 0.5, 0.0, 0.5])), no_mirror);
    assert_eq!(
        refusal(&|robot| robot.legs[3].limits.swing[1] = 0.5).unwrap(),
        "leg `front_left` of doggo has no equal leg in its place on the other side"
    );
}

#[test]
fn a_symmetric_policy_has_to_observe_the_phase() {
    let policy =
        PolicySettings { observation: vec![BlockChoice::MotorAngles], ..symmetric(ModulationChoice::Modulate) };
    let robot = std::sync::Arc::new(Robot::load("doggo").unwrap());
    let problems = Document::parse("my.toml", b"").unwrap().problems();
    let settings = (common::task_settings(), common::reward_settings());
    let problems = Task::new(robot, &settings.0, &settings.1, &policy, problems).unwrap_err().to_string();
    assert!(problems.contains("policy.symmetric"), "{problems}");
    assert!(problems.contains("the policy has to observe `phase`; else set it to false"), "{problems}");
}
