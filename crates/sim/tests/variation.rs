//! What each variation does, by hand-computed effect, and that nothing happens where nothing varies.

mod common;

use std::sync::Arc;

use canter_sim::mujoco::ObjectKind;
use canter_sim::settings::Document;
use canter_sim::task::ModulationChoice;
use canter_sim::variation::{Variant, VariationSettings};
use canter_sim::{Env, Robot, Task};

const ALL: Variant = Variant { place: 0.5, level: 1.0 };

fn task(variation: VariationSettings) -> Arc<Task> {
    let mut settings = common::task_settings();
    settings.start_noise_rad = 0.0;
    settings.variation = variation;
    common::doggo(&settings, &common::policy_settings("sine", ModulationChoice::Direct))
}

/// An environment in its first episode.
fn begun(task: &Arc<Task>, variant: Variant, seed: u64) -> Env {
    let mut env = Env::new(task.clone());
    let mut observation = vec![0.0; task.num_observations()];
    env.vary(variant);
    env.reset(&mut common::uniform(seed), &mut observation);
    env
}

/// The numbers of 200 episodes lie in the range and fill it.
#[track_caller]
fn assert_fills(range: [f64; 2], number: impl Fn(u64) -> f64) {
    let numbers: Vec<f64> = (0..200).map(number).collect();
    let [low, high] = range;
    assert!(numbers.iter().all(|number| (low - 1e-9..=high + 1e-9).contains(number)), "{numbers:?}");
    let tenth = 0.1 * (high - low);
    assert!(numbers.iter().any(|&number| number < low + tenth), "{numbers:?}");
    assert!(numbers.iter().any(|&number| number > high - tenth), "{numbers:?}");
}

#[test]
fn masses_friction_and_gains_are_what_was_drawn() {
    let robot = Robot::load("doggo").unwrap();
    let own = robot.model.raw();
    let task = task(VariationSettings {
        mass_factor: Some(vec![0.8, 1.2]),
        friction: Some(vec![0.5, 1.3]),
        gain_factor: Some(vec![0.9, 1.1]),
        ..VariationSettings::nothing()
    });
    let model = |seed: u64, number: &dyn Fn(&Env) -> f64| number(&begun(&task, ALL, seed));
    assert_fills([0.8, 1.2], |seed| {
        model(seed, &|env| env.simulation().model().totalmass() / robot.model.total_mass_kg())
    });
    assert_fills([0.5, 1.3], |seed| {
        model(seed, &|env| {
            let friction = env.simulation().model().geom_friction();
            assert!(friction.iter().all(|geom| geom[0] == friction[0][0]));
            friction[0][0]
        })
    });
    assert_fills([0.9, 1.1], |seed| {
        model(seed, &|env| {
            let model = env.simulation().model();
            let factor = model.actuator_gainprm()[0][0] / own.actuator_gainprm()[0][0];
            // Stiffness and damping alike.
            assert!((model.actuator_biasprm()[0][1] - factor * own.actuator_biasprm()[0][1]).abs() < 1e-12);
            assert!((model.actuator_biasprm()[0][2] - factor * own.actuator_biasprm()[0][2]).abs() < 1e-12);
            factor
        })
    });
}

#[test]
fn episodes_do_not_add_up() {
    let task = task(VariationSettings {
        mass_factor: Some(vec![1.1, 1.2]),
        com_shift: Some(0.3),
        ..VariationSettings::nothing()
    });
    let mut env = Env::new(task.clone());
    let mut observation = vec![0.0; task.num_observations()];
    env.vary(ALL);
    for seed in 0..50 {
        env.reset(&mut common::uniform(seed), &mut observation);
    }
    let alone = begun(&task, ALL, 49);
    assert_eq!(env.simulation().model().body_mass(), alone.simulation().model().body_mass());
    assert_eq!(env.simulation().model().body_ipos(), alone.simulation().model().body_ipos());
    assert_eq!(env.state(), alone.state());
}

#[test]
fn a_shifted_centre_of_mass_moves_no_geom_and_is_where_it_should_be() {
    let shifted = task(VariationSettings { com_shift: Some(0.5), ..VariationSettings::nothing() });
    let plain = task(VariationSettings::nothing());
    let robot = Robot::load("doggo").unwrap();
    let chassis = robot.model.id(ObjectKind::Body, "chassis").unwrap();
    let (mut env, mut own) = (begun(&shifted, ALL, 2), begun(&plain, ALL, 2));
    // Positions, of feet and hips among others.
    let [moved, stayed] = [env.snapshot(), own.snapshot()];
    for (a, b) in moved.legs.iter().zip(&stayed.legs) {
        assert!(a.foot.iter().zip(b.foot).all(|(a, b)| (a - b).abs() < 1e-9), "{a:?} {b:?}");
    }
    let (geoms, own_geoms) =
        (env.simulation().geom_positions_in_world().to_vec(), own.simulation().geom_positions_in_world().to_vec());
    assert!(geoms.iter().flatten().zip(own_geoms.iter().flatten()).all(|(a, b)| (a - b).abs() < 1e-9));
    let shift: Vec<f64> = (0..3)
        .map(|axis| {
            env.simulation().model().body_ipos()[chassis][axis] - own.simulation().model().body_ipos()[chassis][axis]
        })
        .collect();
    assert!(shift.iter().all(|shift| shift.abs() <= 0.5 * 0.17) && shift.iter().any(|shift| shift.abs() > 0.01));
    assert_eq!(env.simulation().model().totalmass(), own.simulation().model().totalmass());
    // Thrown over, it lies on its side or back: MuJoCo finds the trunk's contacts where the trunk is.
    let mut observation = vec![0.0; shifted.num_observations()];
    env.push([0.0, 4.0, 0.0]);
    (0..300).for_each(|_| _ = env.step(&[0.0; 8], &mut observation));
    let lying = env.snapshot();
    assert!(lying.num_body_contacts > 0 && lying.position[2] > 0.05, "{lying:?}");
}

#[test]
fn strength_scales_the_torque_that_a_stalled_motor_gives() {
    let torque = |strength_factor: Option<f64>| {
        let mut settings = common::task_settings();
        settings.strength_factor = strength_factor;
        settings.start_noise_rad = 0.0;
        let task = common::doggo(&settings, &common::policy_settings("sine", ModulationChoice::Direct));
        let mut env = begun(&task, ALL, 1);
        let mut observation = vec![0.0; task.num_observations()];
        // Asked for more than it can give: 4.2 N m at the current limit.
        let asked = [-1.0, 1.0, -1.0, 1.0, -1.0, 1.0, -1.0, 1.0];
        let mut largest = 0.0_f64;
        for _ in 0..30 {
            env.step(&asked, &mut observation);
            largest = env.snapshot().torques_nm.iter().fold(largest, |largest, torque| largest.max(torque.abs()));
        }
        let range = env.simulation().model().jnt_actfrcrange();
        (largest, range.iter().flatten().fold(0.0, |largest: f64, limit| largest.max(limit.abs())))
    };
    let (given, limit) = torque(None);
    assert!((limit - 4.2).abs() < 1e-9 && given <= 4.2 + 1e-9, "{given} {limit}");
    let (given, limit) = torque(Some(0.5));
    assert!((limit - 2.1).abs() < 1e-9 && given <= 2.1 + 1e-9, "{given} {limit}");
}

#[test]
fn a_delay_shifts_the_commands_by_exactly_that_many_physics_steps() {
    // The stiff steps of a motor's torque show when a command acts: targets jump once, from standing to elsewhere.
    let first_change = |delay_s: f64| {
        let mut settings = common::task_settings();
        settings.delay_s = Some(delay_s);
        settings.control_dt_s = 0.002;
        settings.start_noise_rad = 0.0;
        let policy = common::policy_settings("stepping", ModulationChoice::Direct);
        let task = common::doggo(&settings, &policy);
        assert_eq!(task.num_substeps, 1);
        let mut env = begun(&task, ALL, 1);
        let mut observation = vec![0.0; task.num_observations()];
        let standing = env.last_command().to_vec();
        (0..40).find(|_| {
            env.step(&[0.3; 8], &mut observation);
            let acting = env.snapshot().legs[0].commanded;
            let robot = &task.robot;
            let stood = robot.legs[0].position_at([standing[0], standing[1]]);
            (acting.swing - stood.swing).abs() + (acting.extension - stood.extension).abs() > 1e-3
        })
    };
    for (delay_s, steps) in [(0.0, 0), (0.002, 1), (0.014, 7), (0.05, 25)] {
        assert_eq!(first_change(delay_s), Some(steps), "{delay_s} s");
    }
}

#[test]
fn the_robots_own_delay_said_in_seconds_is_the_same_physics() {
    let walk = |delay_s: Option<f64>| {
        let mut settings = common::task_settings();
        settings.delay_s = delay_s;
        let task = common::doggo(&settings, &common::policy_settings("sine", ModulationChoice::Direct));
        let mut env = begun(&task, ALL, 1);
        let mut observation = vec![0.0; task.num_observations()];
        (0..100).for_each(|_| _ = env.step_prior(&mut observation));
        env.state()
    };
    assert_eq!(walk(None), walk(Some(0.01)));
    assert_ne!(walk(None)[..3], walk(Some(0.012))[..3]);
}

#[test]
fn noise_is_in_what_the_sensors_say_and_nowhere_else() {
    let noisy = task(VariationSettings {
        angle_noise_rad: Some(0.02),
        orientation_noise_rad: Some(0.05),
        ..VariationSettings::nothing()
    });
    let plain = task(VariationSettings::nothing());
    let (mut a, mut b) = (begun(&noisy, ALL, 1), begun(&plain, ALL, 1));
    let (mut heard, mut true_) = (vec![0.0; noisy.num_observations()], vec![0.0; plain.num_observations()]);
    let mut errors = Vec::new();
    for _ in 0..200 {
        a.step_prior(&mut heard);
        b.step_prior(&mut true_);
        assert_eq!(a.position_in_ground(), b.position_in_ground());
        assert_eq!(a.snapshot().legs, b.snapshot().legs);
        // Angles, velocities, then roll, pitch, yaw.
        errors.extend((0..8).map(|i| f64::from(heard[i] - true_[i])));
        assert_eq!(heard[8..16], true_[8..16]);
        assert!((16..19).all(|i| (heard[i] - true_[i]).abs() <= 0.0501));
    }
    let rms = (errors.iter().map(|error| error * error).sum::<f64>() / errors.len() as f64).sqrt();
    // Even over +-0.02: 0.02 / sqrt 3.
    assert!((rms - 0.02 / 3_f64.sqrt()).abs() < 5e-4, "{rms}");
    assert!(errors.iter().all(|error| error.abs() <= 0.02001));
}

#[test]
fn pushes_come_once_an_interval_and_are_as_large_as_said() {
    let task = task(VariationSettings {
        push_interval_s: Some(0.5),
        push_velocity: Some(0.4),
        ..VariationSettings::nothing()
    });
    // sqrt(9.81 * 0.17) = 1.2914 m/s
    let largest = 0.4 * 1.2914;
    let mut sizes = Vec::new();
    for seed in 0..10 {
        let (mut pushed, mut level_0) =
            (begun(&task, ALL, seed), begun(&task, Variant { place: 0.5, level: 0.0 }, seed));
        let mut observation = vec![0.0; task.num_observations()];
        let mut steps = Vec::new();
        for step in 0..150 {
            // From the same state, so that what differs is this step's push.
            let mut state = pushed.state();
            let physics = state.len() - pushed.simulation().state().len();
            state.truncate(physics);
            let before = pushed.velocity_in_ground();
            pushed.step(&[0.0; 8], &mut observation);
            let after = pushed.velocity_in_ground();
            let change = (after[0] - before[0]).hypot(after[1] - before[1]);
            level_0.step(&[0.0; 8], &mut observation);
            if change > 0.1 {
                steps.push(step);
                sizes.push(change);
            }
        }
        assert!(steps.windows(2).all(|pair| pair[1] - pair[0] >= 1), "{steps:?}");
        // A push of no size is none.
        let speed = level_0.velocity_in_ground();
        assert!(speed[0].hypot(speed[1]) < 0.02, "{speed:?}");
    }
    assert!(sizes.len() >= 5 && sizes.iter().all(|&size| size < 1.1 * largest), "{sizes:?}");
}

#[test]
fn a_level_scales_slopes_roughness_and_pushes() {
    let task = task(VariationSettings {
        slope_deg: Some(vec![0.0, 20.0]),
        curriculum: Some(true),
        ..VariationSettings::nothing()
    });
    let pitch_deg = |level: f64| {
        let mut env = Env::new(task.clone());
        let mut observation = vec![0.0; task.num_observations()];
        env.vary(Variant { place: 0.5, level });
        env.reset(&mut common::uniform(1), &mut observation);
        -observation[17].to_degrees()
    };
    for (level, slope_deg) in [(0.0, 0.0), (0.5, 5.0), (1.0, 10.0)] {
        assert!((pitch_deg(level) - slope_deg).abs() < 1e-4, "{level}");
    }
}

#[test]
fn ground_that_rises_to_the_left_shows_in_the_roll_and_pulls_right() {
    let mut settings = common::task_settings();
    settings.start_noise_rad = 0.0;
    settings.cross_slope_deg = Some(10.0);
    let task = common::doggo(&settings, &common::policy_settings("sine", ModulationChoice::Direct));
    let mut env = Env::new(task.clone());
    let mut observation = vec![0.0; task.num_observations()];
    env.reset(&mut common::uniform(1), &mut observation);
    assert!((observation[16].to_degrees() - 10.0).abs() < 1e-4 && observation[17].abs() < 1e-6);
    let gravity = env.simulation().model().opt().gravity;
    assert!((gravity[1] + 9.81 * 10_f64.to_radians().sin()).abs() < 1e-12);
    (0..200).for_each(|_| _ = env.step_prior(&mut observation));
    assert!(env.position_in_ground()[1] < -0.05, "{:?}", env.position_in_ground());
}

#[test]
fn with_everything_on_a_restored_environment_goes_on_with_the_same_bytes() {
    let task = task(VariationSettings {
        share: Some(0.9),
        slope_deg: Some(vec![-5.0, 10.0]),
        cross_slope_deg: Some(vec![-5.0, 5.0]),
        roughness: Some(vec![0.0, 0.1]),
        friction: Some(vec![0.5, 1.2]),
        mass_factor: Some(vec![0.8, 1.2]),
        com_shift: Some(0.1),
        strength_factor: Some(vec![0.8, 1.2]),
        gain_factor: Some(vec![0.8, 1.2]),
        delay_s: Some(vec![0.0, 0.03]),
        angle_noise_rad: Some(0.01),
        velocity_noise_rad_per_s: Some(0.3),
        orientation_noise_rad: Some(0.01),
        angular_velocity_noise_rad_per_s: Some(0.1),
        push_interval_s: Some(0.3),
        push_velocity: Some(0.2),
        curriculum: Some(true),
    });
    for seed in 0..5 {
        let mut original = begun(&task, Variant { place: 0.2 * seed as f64, level: 0.6 }, seed);
        let mut observation = vec![0.0; task.num_observations()];
        (0..77).for_each(|_| _ = original.step_prior(&mut observation));
        // It has been elsewhere before.
        let mut restored = begun(&task, Variant { place: 0.95, level: 1.0 }, seed + 100);
        let mut restored_observation = vec![0.0; task.num_observations()];
        restored.set_state(&original.state(), &mut restored_observation).unwrap();
        assert_eq!(observation, restored_observation, "{seed}");
        for _ in 0..100 {
            assert_eq!(original.step_prior(&mut observation), restored.step_prior(&mut restored_observation), "{seed}");
            assert_eq!(observation, restored_observation, "{seed}");
        }
        assert_eq!(original.state(), restored.state());
    }
}

#[test]
fn what_varies_by_halves_is_refused() {
    let refusal = |variation: VariationSettings| {
        let mut settings = common::task_settings();
        settings.variation = variation;
        let problems = Document::parse("test", b"").unwrap().problems();
        let policy = common::policy_settings("sine", ModulationChoice::Direct);
        let robot = Arc::new(Robot::load("doggo").unwrap());
        Task::new(robot, &settings, &common::reward_settings(), &policy, problems).unwrap_err().to_string()
    };
    let message = refusal(VariationSettings { push_velocity: Some(0.1), ..VariationSettings::nothing() });
    assert!(message.contains("pushes need a push_interval_s as well"), "{message}");
    let message = refusal(VariationSettings { curriculum: Some(true), ..VariationSettings::nothing() });
    assert!(message.contains("no slopes, roughness or pushes vary that could grow"), "{message}");
    let message = refusal(VariationSettings { friction: Some(vec![1.0, 0.5]), ..VariationSettings::nothing() });
    assert!(message.contains("1 is not less than 0.5"), "{message}");
}
