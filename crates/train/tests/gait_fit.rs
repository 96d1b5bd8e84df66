//! Gaits that were written as tables are found again, and what is no such gait is told apart.

use canter_gait::LegPosition;
use canter_sim::robot::{Footfall, GaitSettings, SineSettings, SteppingSettings, built_in_robots};
use canter_sim::settings::{Document, write_plain};
use canter_sim::{NamedGait, Robot};
use canter_train::gait_fit::{Fit, FitError, GaitBlock, Shape, closest, fit, targets};

fn doggo() -> Robot {
    Robot::load("doggo").unwrap()
}

fn settings(robot: &Robot, name: &str) -> GaitSettings {
    robot.settings.gaits.iter().find(|gait| gait.name() == name).unwrap().clone()
}

fn stepping(fit: &Fit) -> &SteppingSettings {
    let GaitSettings::Stepping(settings) = &fit.settings else { panic!("{:?}", fit.settings) };
    settings
}

fn sine(fit: &Fit) -> &SineSettings {
    let GaitSettings::Sine(settings) = &fit.settings else { panic!("{:?}", fit.settings) };
    settings
}

#[track_caller]
fn assert_near(found: f64, expected: f64, tolerance: f64) {
    assert!((found - expected).abs() <= tolerance, "{found} is not {expected}");
}

#[test]
fn the_firmwares_trot_is_found_in_its_table() {
    let robot = doggo();
    let GaitSettings::Stepping(original) = settings(&robot, "stepping") else { panic!() };
    // 50 rows: every 10 ms of its 2 Hz, so that touchdown is between two rows.
    let table = targets(&robot, robot.gait("stepping").unwrap(), 50);
    let found = closest(&robot, &table, original.stride_frequency_hz).unwrap();
    let settings = stepping(&found);
    assert_near(settings.stance_height_m, original.stance_height_m, 2e-4);
    assert_near(settings.down_amplitude_m, original.down_amplitude_m, 2e-4);
    assert_near(settings.up_amplitude_m, original.up_amplitude_m, 2e-4);
    assert_near(settings.step_length_m, original.step_length_m, 2e-4);
    assert_near(settings.flight_fraction, original.flight_fraction, 1e-3);
    assert_eq!((settings.footfall, &settings.phase_offsets_cycles), (Footfall::Trot, &None));
    assert_eq!(settings.stride_frequency_hz, original.stride_frequency_hz);
    assert!(found.rms_rad < 1e-3 && found.leg_rms_rad.iter().all(|rms| *rms < 1e-3), "{found:?}");
}

#[test]
fn every_robots_own_gaits_are_found_in_their_tables() {
    for name in built_in_robots() {
        let robot = Robot::load(name).unwrap();
        for gait in &robot.gaits {
            let shape = match settings(&robot, &gait.name) {
                GaitSettings::Sine(_) => Shape::Sine,
                GaitSettings::Stepping(_) => Shape::Stepping,
                GaitSettings::Table(_) => continue,
            };
            let table = targets(&robot, gait, 64);
            let found = fit(&robot, &table, f64::from(gait.stride_frequency_hz), shape).unwrap();
            assert!(found.rms_rad < 3e-3, "{name} {}: {} rad, {:?}", gait.name, found.rms_rad, found.settings);
        }
    }
}

#[test]
fn sines_of_any_phases_and_offsets_are_found_in_their_table() {
    let robot = doggo();
    let original = SineSettings {
        name: "odd".to_owned(),
        default: false,
        stable: false,
        footfall: Footfall::Custom,
        phase_offsets_cycles: Some(vec![0.1, 0.35, 0.6, 0.95]),
        stride_frequency_hz: 1.5,
        swing_amplitude_rad: 0.3,
        extension_amplitude_rad: 0.2,
        extension_phase_cycles: 0.7,
        swing_offset_rad: Some(0.1),
        extension_offset_rad: Some(-0.05),
    };
    let gait = robot.shaped_gait(&GaitSettings::Sine(original.clone())).unwrap();
    let found = closest(&robot, &targets(&robot, &gait, 40), 1.5).unwrap();
    let expected = SineSettings { name: "fitted".to_owned(), ..original };
    assert_eq!((sine(&found), found.shift_cycles), (&expected, 0.0));
    assert!(found.rms_rad < 1e-4, "{}", found.rms_rad);
}

#[test]
fn a_table_that_begins_elsewhere_in_the_cycle_keeps_its_footfall() {
    let robot = doggo();
    let mut table = targets(&robot, robot.gait("sine").unwrap(), 40);
    table.rotate_left(10);
    let found = closest(&robot, &table, 2.0).unwrap();
    assert_eq!(sine(&found).footfall, Footfall::Trot);
    assert_near(found.shift_cycles, 0.25, 1e-3);
    assert!(found.rms_rad < 1e-3);
}

#[test]
fn what_is_left_is_told_leg_by_leg() {
    let robot = doggo();
    // 0.04 rad up and down in turn is no sine of one cycle: all of it is left, on one leg's extension.
    let mut table = targets(&robot, robot.gait("sine").unwrap(), 64);
    for (row, targets) in table.iter_mut().enumerate() {
        targets[3] += if row % 2 == 0 { 0.04 } else { -0.04 };
    }
    let found = fit(&robot, &table, 2.0, Shape::Sine).unwrap();
    // sqrt(0.04^2 / 2) on that leg, half of it over four legs.
    assert_near(found.leg_rms_rad[1], 0.02828, 2e-4);
    assert!(found.leg_rms_rad[0] < 1e-3);
    assert_near(found.rms_rad, 0.01414, 2e-4);
}

/// The difference of table and gait, from the gait's own targets.
fn difference_rad(robot: &Robot, table: &[Vec<f32>], found: &Fit) -> f64 {
    let mut sum = 0.0;
    for (row, expected) in table.iter().enumerate() {
        let phase = row as f32 / table.len() as f32 + found.shift_cycles as f32;
        for (leg, part) in found.gait.legs.iter().enumerate() {
            let LegPosition { swing, extension } = robot.legs[leg].limits.clamp(part.position(phase, &part.defaults));
            sum += f64::from(swing - expected[2 * leg]).powi(2) + f64::from(extension - expected[2 * leg + 1]).powi(2);
        }
    }
    (sum / (table.len() * table[0].len()) as f64).sqrt()
}

#[test]
fn a_random_table_is_no_gait_and_its_fits_say_so() {
    let robot = doggo();
    // A linear congruential generator, Knuth's MMIX.
    let mut state = 1_u64;
    let mut uniform = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f32 / (1 << 24) as f32
    };
    let table: Vec<Vec<f32>> = (0..32).map(|_| (0..8).map(|_| 0.6 * uniform() - 0.3).collect()).collect();
    let fits: Vec<Fit> = Shape::ALL.iter().map(|&shape| fit(&robot, &table, 2.0, shape).unwrap()).collect();
    for found in &fits {
        // Uniform over 0.6 rad has a standard deviation of 0.173 rad; a dozen numbers cannot follow 256.
        assert!((0.12..0.18).contains(&found.rms_rad), "{}", found.rms_rad);
        assert_near(difference_rad(&robot, &table, found), found.rms_rad, 1e-5);
    }
    let best = closest(&robot, &table, 2.0).unwrap();
    assert_eq!(best.rms_rad, fits[0].rms_rad.min(fits[1].rms_rad));
    assert_eq!(best, closest(&robot, &table, 2.0).unwrap());
}

#[test]
fn the_block_reads_back_as_the_gait() {
    let robot = doggo();
    for name in ["stepping", "sine"] {
        let found = closest(&robot, &targets(&robot, robot.gait(name).unwrap(), 64), 2.0).unwrap();
        let text = write_plain(&GaitBlock { gaits: vec![found.settings.clone()] });
        assert!(text.contains("[[gaits]]"), "{text}");
        let back: GaitBlock = Document::parse("block", text.as_bytes()).unwrap().read().unwrap();
        let gait: NamedGait = robot.shaped_gait(&back.gaits[0]).unwrap();
        assert_eq!(gait, found.gait);
    }
}

#[test]
fn tables_that_are_no_gait_are_refused() {
    let robot = doggo();
    let table = targets(&robot, robot.gait("sine").unwrap(), 16);
    let refused = |table: &[Vec<f32>], frequency_hz: f64| closest(&robot, table, frequency_hz).unwrap_err();
    assert_eq!(refused(&table[..3], 2.0), FitError::Rows(3));
    assert_eq!(refused(&table, 0.0), FitError::Frequency(0.0));
    assert!(matches!(refused(&table, f64::NAN), FitError::Frequency(_)));
    let mut short = table.clone();
    short[4].pop();
    assert_eq!(refused(&short, 2.0), FitError::Width { row: 5, found: 7, expected: 8 });
    let mut broken = table.clone();
    broken[6][2] = f32::NAN;
    assert_eq!(refused(&broken, 2.0), FitError::NotFinite(7));
    assert_eq!(refused(&vec![vec![0.0; 8]; 16], 2.0), FitError::Still);
}
