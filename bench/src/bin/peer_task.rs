//! What a peer needs to do the same work, and to prove that it does: prints JSON.
//!
//! `robot.toml`, the MJCF and the preset are files that a peer reads itself. From here it has the random starts, in the
//! order in which an environment draws its numbers, the speeds of the default gait and of the prior, and episodes to
//! repeat: actions with the observations and rewards that they bring.
//!
//! ```sh
//! cargo run --release -p canter-bench --bin peer_task
//! ```

use std::sync::Arc;

use canter_bench::level::{conditions, default_speed, resolve_on_level_ground, speed};
use canter_learn::random::{Purpose, stream};
use canter_sim::{Accident, Env, Task};
use canter_train::environment::uniform;
use canter_train::evaluate::Mover;
use canter_train::executor::Workers;
use serde_json::{Value, json};

/// Numbers in [0, 1) that one start takes: the phase, three angles of the body, two of each of four legs.
const NUMBERS_PER_START: usize = 12;

/// Env steps of each repeated episode; a second is what two programs that round differently can walk side by side.
const NUM_ENV_STEPS: usize = 100;

/// Largest action of the walk.
const WALK_SIZE: f32 = 0.3;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let resolved = resolve_on_level_ground(&[])?;
    let task = &resolved.task;
    let conditions = conditions(&resolved);
    let starts = conditions.starts;
    let numbers = |number: u64| -> Vec<f64> {
        let mut rng = stream(conditions.settings.seed, starts.purpose, starts.row, starts.first + number);
        (0..NUMBERS_PER_START).map(|_| uniform(&mut rng)).collect()
    };
    let start = |number| Start::new(task, numbers(number));
    let workers = Workers::new(None)?;
    let gait = task.controller().gait();
    let offsets: Vec<f32> = gait.legs.iter().map(|leg| leg.phase_offset).collect();
    let report = json!({
        "default_speed_m_per_s": default_speed(&resolved, &workers),
        "prior_speed_m_per_s": speed(task, Mover::Prior, &conditions, &workers),
        "phase_offsets_cycles": offsets,
        "mass_kg": task.robot.model.total_mass_kg(),
        "starts": (0..conditions.settings.num_episodes as u64).map(|number| start(number).json()).collect::<Vec<_>>(),
        "episodes": [episode(start(0), walk()), episode(start(1), fall)],
    });
    println!("{report}");
    Ok(())
}

/// An environment at the start of an episode.
struct Start {
    env: Env,
    numbers: Vec<f64>,
    /// `(O)`
    observation: Vec<f32>,
}

impl Start {
    fn new(task: &Arc<Task>, numbers: Vec<f64>) -> Self {
        let mut env = Env::new(task.clone());
        let mut observation = vec![0.0; task.num_observations()];
        let mut drawn = numbers.iter().copied();
        env.reset(&mut || drawn.next().expect("enough numbers for a start"), &mut observation);
        Self { env, numbers, observation }
    }

    /// The numbers, and the positions that come of them to the last bit: it decides whether the lowest foot, which just
    /// touches the ground, has a contact in the first step.
    fn json(&self) -> Value {
        json!({ "numbers": self.numbers, "qpos": self.env.simulation().qpos(), "observation": self.observation })
    }
}

/// One episode under actions that `act` writes, given the number of the env step.
fn episode(start: Start, mut act: impl FnMut(usize, &mut [f32])) -> Value {
    let described = start.json();
    let Start { mut env, mut observation, .. } = start;
    let mut action = vec![0.0; env.task().num_actions()];
    let mut steps = Vec::new();
    for step in 0..NUM_ENV_STEPS {
        act(step, &mut action);
        let outcome = env.step(&action, &mut observation);
        steps.push(json!({
            "action": action,
            "observation": observation,
            "reward": outcome.reward,
            "terminated": outcome.terminated.map(Accident::name),
        }));
        if outcome.terminated.is_some() {
            break;
        }
    }
    json!({ "start": described, "steps": steps })
}

/// New random actions every tenth of a second: the robot walks on.
fn walk() -> impl FnMut(usize, &mut [f32]) {
    let mut rng = stream(0, Purpose::Exploration, 0, 0);
    move |step, action| {
        if step % 10 == 0 {
            action.fill_with(|| WALK_SIZE * (2.0 * uniform(&mut rng) - 1.0) as f32);
        }
    }
}

/// The greatest frequency and swing amplitude: the robot falls, after it has earned a return to lose.
fn fall(_step: usize, action: &mut [f32]) {
    action.fill(0.0);
    action[0] = 1.0;
    action[1..].iter_mut().step_by(4).for_each(|swing_amplitude| *swing_amplitude = 1.0);
}
