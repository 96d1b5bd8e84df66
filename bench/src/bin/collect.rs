//! What collecting costs beside the physics steps that it contains, and what updating costs beside collecting.
//!
//! The `doggo` preset is trained for a few iterations, so that the robot moves. Then, environment by environment, one
//! thread, in turns, with the same start and the same commands:
//!
//! - **collect**: `collect_column` fills the environment's column of a rollout;
//! - **bare**: the same physics steps, calls of `mj_step` with nothing between them but the copy of the commands once
//!   per env step. Starts of episodes are restored from a recording while the clock stands still.
//!
//! Both must end in the same state, bit for bit, or the program fails. Costs are also given in reference `mj_step`s,
//! which are timed in turns with the rest.
//!
//! ```sh
//! cargo run --release -p canter-bench --bin collect
//! ```

use std::fs;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use canter_bench::bare::{BareSimulation, Event, Recording};
use canter_bench::level::{PRESET, resolve_on_level_ground};
use canter_bench::reference::Reference;
use canter_gait::Network;
use canter_learn::collect::{CollectorState, PolicyView, collect_column};
use canter_learn::environment::{Environment, StepOutcome};
use canter_learn::random::{Purpose, stream};
use canter_learn::rollout::Rollout;
use canter_sim::Task;
use canter_sim::forward::fastest_forward;
use canter_train::config::{ConfigError, Resolved, open_preset, resolve};
use canter_train::environment::TrainingEnvironment;
use canter_train::executor::Workers;
use canter_train::statistics::{bootstrap_interval, mean, quantile};
use canter_train::trainer::{IterationReport, Trainer};
use clap::Parser;
use rand_chacha::ChaCha8Rng;
use serde::Serialize;

/// Compares collecting with the bare physics steps that it contains.
#[derive(Debug, Parser)]
struct Args {
    /// Iterations of training before anything is compared
    #[arg(long, value_name = "N", default_value_t = 30, value_parser = clap::value_parser!(u32).range(1..))]
    iterations: u32,
    /// Rounds over all environments
    #[arg(long, value_name = "N", default_value_t = 12, value_parser = clap::value_parser!(u32).range(1..))]
    rounds: u32,
    /// Threads of the training, not of the comparison; as many as there are cores if not given
    #[arg(long, value_name = "N")]
    threads: Option<usize>,
    /// Also write the numbers to this file
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// The benchmark's result.
#[derive(Debug, Serialize)]
struct Report {
    /// Pairs of timings: one column of one environment each.
    num_pairs: usize,
    /// Env steps of a column.
    horizon: usize,
    /// Physics steps of an env step.
    num_substeps: u32,
    /// Median over the pairs of collecting time over bare time.
    ratio: f64,
    /// 95 % bootstrap interval of that median.
    ratio_ci: [f64; 2],
    /// First and third quartile of the pairs' ratios.
    ratio_quartiles: [f64; 2],
    /// Median over the pairs, one thread [1/s].
    collect_env_steps_per_s: f64,
    /// The same for the bare physics steps [1/s].
    bare_env_steps_per_s: f64,
    /// Median over the pairs of the difference per env step [ns].
    overhead_ns_per_env_step: f64,
    /// Median over the rounds of one reference `mj_step` [ns].
    reference_mj_step_ns: f64,
    /// The overhead of collecting per env step in reference `mj_step`s.
    overhead_in_mj_steps: f64,
    /// Wall time of advantages and update by samples of the rollout, in reference `mj_step`s.
    update_in_mj_steps_per_sample: f64,
    /// Threads of the training.
    training_threads: usize,
    /// Mean wall time of collecting in one iteration of training [s].
    training_collect_s: f64,
    /// Mean wall time of advantages and update in one iteration of training [s].
    training_update_s: f64,
    /// The update's share of both.
    training_update_share: f64,
    /// Mean forward speed in the last iteration of training [m/s]: whether the robot moves.
    training_speed_m_per_s: f64,
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let args = Args::parse();
    let workers = Workers::new(args.threads)?;
    let mut trainer = Trainer::new(resolve(&open_preset(PRESET)?)?);
    let mut iterations = Vec::new();
    for _ in 0..args.iterations {
        iterations.push(trainer.iterate(&workers)?);
    }
    let task = resolve_on_level_ground(&[])?.task;
    let timings = compare(&trainer, &task, &iterations, args.rounds)?;
    let report = Report::new(&timings, &iterations, trainer.resolved(), workers.num_threads());
    report.print();
    if let Some(path) = &args.json {
        fs::write(path, serde_json::to_string_pretty(&report)? + "\n")?;
    }
    Ok(())
}

/// Times of one column of one environment [s].
#[derive(Clone, Copy, Debug)]
struct Pair {
    collect_s: f64,
    bare_s: f64,
}

/// Everything that was timed.
struct Timings {
    pairs: Vec<Pair>,
    /// One reference `mj_step` [s], once a round.
    reference_s: Vec<f64>,
}

/// Collects and replays every environment's column, `rounds` times, with the trained policy, on level ground.
fn compare(
    trainer: &Trainer,
    task: &Arc<Task>,
    iterations: &[IterationReport],
    rounds: u32,
) -> Result<Timings, ConfigError> {
    let config = &trainer.resolved().config;
    let (model, normaliser) = (trainer.model(), trainer.normaliser());
    // The mean spread for every component: what the noise is makes no difference to the time.
    let mean_std = iterations.last().map_or(1.0, |report| report.mean_std);
    let log_std = vec![mean_std.ln() as f32; model.num_actions()];
    let policy = PolicyView {
        actor: Network::new(model.actor, trainer.actor_parameters()).expect("the model's own part"),
        log_std: &log_std,
        normaliser: &normaliser,
        forward: fastest_forward(),
    };
    let num_environments = config.training.num_environments as u64;
    // Another seed than the training's: starts that it has not seen.
    let seed = config.seed + 1;
    let mut columns: Vec<Column> =
        (0..num_environments).map(|index| Column::new(task, seed, index, config.training.horizon)).collect();
    let (mut bare, mut reference) = (BareSimulation::new(task), Reference::new()?);
    // The first round warms up caches and starts all episodes, so that the rounds that count have walking robots.
    let mut timings = Timings { pairs: Vec::new(), reference_s: Vec::new() };
    for round in 0..=rounds {
        for (index, column) in columns.iter_mut().enumerate() {
            let rng = || stream(seed, Purpose::Exploration, index as u64, u64::from(round));
            let recording = column.record(&policy, rng());
            // Neither is always the first.
            let is_bare_first = (round as usize + index) % 2 == 1;
            let bare_first_s = is_bare_first.then(|| bare.replay(&recording));
            let collect_s = column.collect(&policy, rng());
            let bare_s = bare_first_s.unwrap_or_else(|| bare.replay(&recording));
            assert_eq!(bare.state(), bare.physics(&column.environment.state()), "both did the same work");
            if round > 0 {
                timings.pairs.push(Pair { collect_s, bare_s });
            }
        }
        let reference_s = reference.time();
        if round > 0 {
            timings.reference_s.push(reference_s);
        }
    }
    Ok(timings)
}

/// One environment with its part of a rollout.
struct Column {
    environment: TrainingEnvironment,
    collector: CollectorState,
    rollout: Rollout,
}

impl Column {
    fn new(task: &Arc<Task>, seed: u64, index: u64, horizon: usize) -> Self {
        let mut environment = TrainingEnvironment::new(task.clone(), seed, index, 1);
        Self {
            collector: CollectorState::start(&mut environment),
            rollout: Rollout::new(1, horizon, task.num_observations(), task.num_actions()),
            environment,
        }
    }

    /// Collects and returns the time it took [s].
    fn collect(&mut self, policy: &PolicyView<'_>, mut rng: ChaCha8Rng) -> f64 {
        let mut column = self.rollout.columns_mut().next().expect("one environment");
        let start = Instant::now();
        collect_column(&mut self.environment, policy, &mut column, &mut self.collector, &mut rng);
        start.elapsed().as_secs_f64()
    }

    /// Collects with a recorder between environment and learner, then goes back to before.
    fn record(&mut self, policy: &PolicyView<'_>, mut rng: ChaCha8Rng) -> Recording {
        let before = self.environment.state();
        let ongoing = self.collector.ongoing.clone();
        let mut recorder = Recorder { environment: &mut self.environment, events: vec![Event::Start(before.clone())] };
        let mut column = self.rollout.columns_mut().next().expect("one environment");
        collect_column(&mut recorder, policy, &mut column, &mut self.collector, &mut rng);
        let events = recorder.events;
        let mut observation = ongoing.observation.clone();
        self.environment.set_state(&before, &mut observation).expect("its own state");
        assert_eq!(observation, ongoing.observation, "the environment is where it was");
        self.collector.ongoing = ongoing;
        Recording { events }
    }
}

/// Writes down what happens to an environment.
struct Recorder<'a> {
    environment: &'a mut TrainingEnvironment,
    events: Vec<Event>,
}

impl Environment for Recorder<'_> {
    fn num_observations(&self) -> usize {
        self.environment.num_observations()
    }

    fn num_actions(&self) -> usize {
        self.environment.num_actions()
    }

    fn reset(&mut self, observation: &mut [f32]) {
        self.environment.reset(observation);
        self.events.push(Event::Start(self.environment.state()));
    }

    fn step(&mut self, action: &[f32], observation: &mut [f32]) -> StepOutcome {
        let outcome = self.environment.step(action, observation);
        self.events.push(Event::Step(self.environment.state()));
        outcome
    }
}

impl Report {
    fn new(timings: &Timings, iterations: &[IterationReport], resolved: &Resolved, training_threads: usize) -> Self {
        let (pairs, training) = (&timings.pairs, &resolved.config.training);
        let horizon = training.horizon;
        let sorted = |value: &dyn Fn(&Pair) -> f64| {
            let mut values: Vec<f64> = pairs.iter().map(value).collect();
            values.sort_by(f64::total_cmp);
            values
        };
        let ratios = sorted(&|pair| pair.collect_s / pair.bare_s);
        let median_of = |group: &[f64]| {
            let mut values = group.to_vec();
            values.sort_by(f64::total_cmp);
            quantile(&values, 0.5)
        };
        let steps = horizon as f64;
        let over = |value: fn(&IterationReport) -> f64| mean(&iterations.iter().map(value).collect::<Vec<_>>());
        let reference_mj_step_ns = 1e9 * median_of(&timings.reference_s);
        let overhead_ns_per_env_step = quantile(&sorted(&|pair| (pair.collect_s - pair.bare_s) * 1e9 / steps), 0.5);
        let update_ns = |update_s: f64| 1e9 * update_s / (training.num_environments * horizon) as f64;
        let (training_collect_s, training_update_s) = (over(|report| report.collect_s), over(|report| report.update_s));
        Self {
            num_pairs: pairs.len(),
            horizon,
            num_substeps: resolved.task.num_substeps,
            ratio: quantile(&ratios, 0.5),
            ratio_ci: bootstrap_interval(&[&ratios], |groups| median_of(&groups[0])),
            ratio_quartiles: [quantile(&ratios, 0.25), quantile(&ratios, 0.75)],
            collect_env_steps_per_s: quantile(&sorted(&|pair| steps / pair.collect_s), 0.5),
            bare_env_steps_per_s: quantile(&sorted(&|pair| steps / pair.bare_s), 0.5),
            overhead_ns_per_env_step,
            reference_mj_step_ns,
            overhead_in_mj_steps: overhead_ns_per_env_step / reference_mj_step_ns,
            update_in_mj_steps_per_sample: update_ns(training_update_s) / reference_mj_step_ns,
            training_threads,
            training_collect_s,
            training_update_s,
            training_update_share: training_update_s / (training_collect_s + training_update_s),
            training_speed_m_per_s: iterations.last().map_or(0.0, |report| report.speed_m_per_s),
        }
    }

    fn print(&self) {
        let [low, high] = self.ratio_ci;
        let [first, third] = self.ratio_quartiles;
        println!("| quantity | value |");
        println!("| --- | --- |");
        println!(
            "| pairs of timings, each {} env steps of {} physics steps | {} |",
            self.horizon, self.num_substeps, self.num_pairs
        );
        println!(
            "| collecting over bare `mj_step`, median [95 % interval] | {:.3} [{low:.3}, {high:.3}] |",
            self.ratio
        );
        println!("| the same, quartiles of the pairs | {first:.3} to {third:.3} |");
        println!("| collecting, one thread | {:.0} env steps/s |", self.collect_env_steps_per_s);
        println!("| bare, one thread | {:.0} env steps/s |", self.bare_env_steps_per_s);
        println!("| overhead of collecting | {:.0} ns per env step |", self.overhead_ns_per_env_step);
        println!("| one reference `mj_step` | {:.0} ns |", self.reference_mj_step_ns);
        println!("| overhead of collecting per env step | {:.3} reference `mj_step` |", self.overhead_in_mj_steps);
        println!("| update per sample | {:.3} reference `mj_step` |", self.update_in_mj_steps_per_sample);
        println!(
            "| one iteration of training, {} threads | {:.3} s collecting, {:.3} s updating |",
            self.training_threads, self.training_collect_s, self.training_update_s
        );
        println!("| the update's share of it | {:.1} % |", 100.0 * self.training_update_share);
        println!("| speed in the last iteration | {:.2} m/s |", self.training_speed_m_per_s);
    }
}
