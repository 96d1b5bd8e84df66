//! `policy.safetensors`: everything that the robot's code needs to run a learned gait, with vectors that prove it.

use canter_gait::mirror::Component;
use canter_gait::{Actuators, LegGeometry, Modulation, Network, NetworkShape, Normaliser, Policy, Waveform};
use canter_sim::mirror::MirrorMaps;
use canter_sim::{NamedGait, Task};
use serde::{Deserialize, Serialize};

use crate::json::largest_number;
use crate::tensors::{TensorError, TensorFile};
use crate::trainer::Trainer;

/// Version of the format; readers refuse others.
pub const FORMAT_VERSION: u32 = 3;

/// Observations of the built-in test vector.
const NUM_TEST_VECTORS: usize = 4;

/// Sizes that a layer of a policy may have; products of three of them do not overflow.
const WIDTHS: std::ops::RangeInclusive<usize> = 1..=1 << 16;

/// The metadata: what is not an array. Keys are sorted in the file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PolicyCard {
    /// See [`FORMAT_VERSION`].
    pub format_version: u32,
    /// The robot it was trained on.
    pub robot: RobotCard,
    /// The gait that it modulates.
    pub gait: GaitCard,
    /// What it may change, as in [`canter_gait::ActionLaw`].
    pub action: ActionCard,
    /// Names of the observation's blocks, in order.
    pub observation: Vec<String>,
    /// In which the second half of the cycle is seen, as in [`canter_gait::Mirror`]; none: it is seen as it is.
    pub mirror: Option<MirrorCard>,
    /// Where it comes from.
    pub provenance: Provenance,
}

/// The robot, as the controller sees it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RobotCard {
    /// Its name.
    pub name: String,
    /// Changes whenever the robot's files do; hexadecimal.
    pub fingerprint: String,
    /// Time between two commands [s].
    pub control_dt_s: f64,
    /// The legs, in their order.
    pub legs: Vec<LegCard>,
}

/// A leg's geometry, maps and limits.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LegCard {
    /// How it is built: `five-bar` or `serial`.
    pub kind: String,
    /// Length of the upper links [m].
    pub upper_link_m: f32,
    /// Length of the lower links [m].
    pub lower_link_m: f32,
    /// Length of the leg in the standing pose [m].
    pub stance_length_m: f32,
    /// Distance between the hips of a five-bar leg [m].
    pub hip_separation_m: f32,
    /// Whether the knee of a serial leg is in front.
    pub knee_in_front: bool,
    /// Null where the actuators are commanded in swing and extension; else for both motor joints 1 or -1, and the joint's
    /// angle in the standing pose [rad].
    pub joints: Option<[(f32, f32); 2]>,
    /// Least and greatest swing [rad].
    pub swing_limits_rad: [f32; 2],
    /// Least and greatest extension [rad].
    pub extension_limits_rad: [f32; 2],
}

/// The gait without the policy.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GaitCard {
    /// Its name in robot.toml.
    pub name: String,
    /// Cycles per second.
    pub stride_frequency_hz: f32,
    /// The legs' parts, in their order.
    pub legs: Vec<LegGaitCard>,
}

/// One leg's part of the gait.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LegGaitCard {
    /// `sine`, `stepping` or `table`.
    pub waveform: String,
    /// The waveform's own numbers: extension phase [cycles]; or stance height, down and up amplitude [m], flight
    /// fraction, step length [m]; or swing and extension of the wave, in [-1, 1], at equal distances over the cycle.
    pub waveform_parameters: Vec<f32>,
    /// What the leg adds to the clock's phase [cycles].
    pub phase_offset: f32,
    /// Swing amplitude, extension amplitude, swing offset, extension offset [rad].
    pub defaults: [f32; 4],
}

/// The action law.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ActionCard {
    /// What the policy may change.
    pub modulation: String,
    /// How much of it.
    pub authority: f32,
    /// Ranges of frequency factor, swing amplitude, extension amplitude, swing offset, extension offset.
    pub ranges: [[f32; 2]; 5],
    /// How far `residual` may move an actuator target at full authority [rad]; absent for other modulations.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub residual_bound_rad: Option<f32>,
}

/// What becomes of observation and action in the mirror.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MirrorCard {
    /// For each component of the observation's image: which component it is of the original, and 1 or -1.
    pub observation: Vec<(usize, f32)>,
    /// The same for the action.
    pub action: Vec<(usize, f32)>,
    /// Which component of the observation is the sine of the phase: the second half is where it is below 0.
    pub sine: usize,
}

/// Where a policy comes from; no time, path or thread count, so that the same run gives the same bytes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Provenance {
    /// Version of canter.
    pub canter: String,
    /// Seed of the run.
    pub seed: u64,
    /// Env steps of training.
    pub env_steps: u64,
    /// Iterations of training.
    pub iterations: u64,
}

/// A policy in memory.
#[derive(Clone, Debug, PartialEq)]
pub struct PolicyFile {
    /// What is not an array.
    pub card: PolicyCard,
    shape: NetworkShape,
    parameters: Vec<f32>,
    mean: Vec<f32>,
    inverse_std: Vec<f32>,
    mirror: Option<MirrorMaps>,
}

/// Why a policy file cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum PolicyError {
    /// The container or an array is wrong.
    #[error(transparent)]
    Tensors(#[from] TensorError),
    /// The metadata is wrong.
    #[error("its metadata cannot be read: {0}")]
    Metadata(#[from] serde_json::Error),
    /// Written by another version.
    #[error("it has format version {found}, this canter reads version {FORMAT_VERSION}")]
    Version {
        /// The file's version.
        found: u64,
    },
    /// A number of the metadata cannot be one.
    #[error("its metadata has a number that is beyond all measure")]
    Number,
    /// The mirror does not lead back to the original, or has not the sizes of the network.
    #[error("its mirror is none")]
    Mirror,
    /// Made for something else.
    #[error("it was trained for {what} {found}, not for {expected}")]
    Mismatch {
        /// What differs.
        what: &'static str,
        /// In the file.
        found: String,
        /// In the task.
        expected: String,
    },
    /// The network does not give, bit for bit, what the file says that it gives.
    #[error(
        "its network does not reproduce its own test vector: the file is damaged or was written by a faulty program"
    )]
    TestVector,
}

impl PolicyFile {
    /// The policy of a training as it is now.
    pub fn of(trainer: &Trainer) -> Self {
        let resolved = trainer.resolved();
        let normaliser = trainer.normaliser();
        let progress = trainer.progress();
        let provenance = Provenance {
            canter: env!("CARGO_PKG_VERSION").to_owned(),
            seed: resolved.config.seed,
            env_steps: progress.env_steps,
            iterations: progress.iterations,
        };
        Self {
            card: PolicyCard::new(&resolved.task, &resolved.config.policy.prior, provenance),
            shape: trainer.model().actor,
            parameters: trainer.actor_parameters().to_vec(),
            mean: normaliser.mean,
            inverse_std: normaliser.inverse_std,
            mirror: resolved.task.mirror_maps().cloned(),
        }
    }

    /// The policy as the robot's code runs it.
    pub fn policy(&self) -> Policy<'_> {
        Policy {
            normaliser: Normaliser { mean: &self.mean, inverse_std: &self.inverse_std },
            network: Network::new(self.shape, &self.parameters).expect("lengths were checked"),
            mirror: self.mirror.as_ref().map(MirrorMaps::mirror),
        }
    }

    /// The file's bytes; the same policy gives the same bytes.
    pub fn to_bytes(&self) -> Vec<u8> {
        // By way of a `Value`, whose keys are sorted.
        let card = serde_json::to_value(&self.card).expect("a card has string keys only");
        let mut file = TensorFile::new(card.to_string());
        // Layers are named as in `actor.0.weight`, `(inputs x outputs)`, and `actor.0.bias`.
        for (i, layer) in self.shape.layers().into_iter().enumerate() {
            let weights = &self.parameters[layer.weights..layer.biases];
            file.push(&format!("actor.{i}.weight"), &[layer.inputs, layer.outputs], weights);
            let biases = &self.parameters[layer.biases..layer.biases + layer.outputs];
            file.push(&format!("actor.{i}.bias"), &[layer.outputs], biases);
        }
        file.push("normaliser.mean", &[self.mean.len()], &self.mean);
        file.push("normaliser.inverse_std", &[self.inverse_std.len()], &self.inverse_std);
        let (observations, actions) = self.test_vectors();
        file.push("test.observation", &[NUM_TEST_VECTORS, self.shape.input], &observations);
        file.push("test.action", &[NUM_TEST_VECTORS, self.shape.output], &actions);
        file.to_bytes()
    }

    /// Reads a policy and lets it prove itself on its test vector.
    ///
    /// # Errors
    /// Bytes that are no policy of this version, or one whose arrays do not fit each other.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, PolicyError> {
        let file = TensorFile::from_bytes(bytes)?;
        let card: serde_json::Value = serde_json::from_str(file.metadata())?;
        let found = card.get("format_version").and_then(serde_json::Value::as_u64).unwrap_or(0);
        if found != u64::from(FORMAT_VERSION) {
            return Err(PolicyError::Version { found });
        }
        // What does not fit would be read as infinite.
        if largest_number(&card) > f64::from(f32::MAX) {
            return Err(PolicyError::Number);
        }
        let card: PolicyCard = serde_json::from_value(card)?;
        let shape_of = |name: &str| match file.shape(name) {
            Some(&[rows, columns]) if WIDTHS.contains(&rows) && WIDTHS.contains(&columns) => Ok((rows, columns)),
            Some(shape) => Err(TensorError::Shape {
                name: name.to_owned(),
                found: format!("{shape:?}"),
                expected: format!("two sizes from {} to {}", WIDTHS.start(), WIDTHS.end()),
            }),
            None => Err(TensorError::Missing(name.to_owned())),
        };
        let (input, hidden) = shape_of("actor.0.weight")?;
        let (_, output) = shape_of("actor.2.weight")?;
        let shape = NetworkShape { input, hidden, output };
        let mut parameters = Vec::new();
        for (i, layer) in shape.layers().into_iter().enumerate() {
            parameters.extend(file.get::<f32>(&format!("actor.{i}.weight"), &[layer.inputs, layer.outputs])?);
            parameters.extend(file.get::<f32>(&format!("actor.{i}.bias"), &[layer.outputs])?);
        }
        let mean = file.get("normaliser.mean", &[input])?;
        let inverse_std = file.get("normaliser.inverse_std", &[input])?;
        let mirror = card.mirror.as_ref().map(|card| card.maps().ok_or(PolicyError::Mirror)).transpose()?;
        if mirror.as_ref().is_some_and(|maps| (maps.observation().len(), maps.action().len()) != (input, output)) {
            return Err(PolicyError::Mirror);
        }
        let policy = Self { card, shape, parameters, mean, inverse_std, mirror };
        let (observations, actions) = policy.test_vectors();
        let same = |name: &str, shape: &[usize], own: &[f32]| file.get::<f32>(name, shape).map(|stored| stored == own);
        let inputs_agree = same("test.observation", &[NUM_TEST_VECTORS, input], &observations)?;
        let outputs_agree = same("test.action", &[NUM_TEST_VECTORS, output], &actions)?;
        if !inputs_agree || !outputs_agree {
            return Err(PolicyError::TestVector);
        }
        Ok(policy)
    }

    /// Checks that the policy was trained for this task: the robot, its gait, what is observed and changed.
    ///
    /// # Errors
    /// [`PolicyError::Mismatch`], naming the first difference.
    pub fn check(&self, task: &Task) -> Result<(), PolicyError> {
        let expected = PolicyCard::new(task, &self.card.gait.name, self.card.provenance.clone());
        let differs = |what, found: &dyn std::fmt::Debug, expected: &dyn std::fmt::Debug| {
            Err(PolicyError::Mismatch { what, found: format!("{found:?}"), expected: format!("{expected:?}") })
        };
        let (own, other) = (&self.card, &expected);
        if own.robot.name != other.robot.name {
            return differs("the robot", &own.robot.name, &other.robot.name);
        }
        if own.observation != other.observation {
            return differs("the observation", &own.observation, &other.observation);
        }
        if own.action != other.action {
            return differs("the action law", &own.action, &other.action);
        }
        if own.mirror != other.mirror {
            let symmetric = |card: &PolicyCard| card.mirror.is_some();
            return differs("policy.symmetric =", &symmetric(own), &symmetric(other));
        }
        if own.gait != other.gait {
            let gait = task.controller().gait();
            let is_present =
                |known: &&NamedGait| known.legs == gait.legs && known.stride_frequency_hz == gait.stride_frequency_hz;
            let present = task.robot.gaits.iter().find(is_present).map_or("", |known| &known.name);
            if own.gait.name != present {
                return differs("the gait", &own.gait.name, &present);
            }
            return differs("another version of the gait", &own.gait.name, &"the robot's present one");
        }
        if own.robot.control_dt_s != other.robot.control_dt_s {
            return differs("a time between commands of", &own.robot.control_dt_s, &other.robot.control_dt_s);
        }
        if own.robot.fingerprint != other.robot.fingerprint || own.robot != other.robot {
            return differs("another version of the robot's files,", &own.robot.fingerprint, &other.robot.fingerprint);
        }
        let sizes = (task.num_observations(), task.num_actions());
        if (self.shape.input, self.shape.output) != sizes {
            return differs("observations and actions of sizes", &(self.shape.input, self.shape.output), &sizes);
        }
        Ok(())
    }

    /// Fixed observations within two standard deviations of the mean, `(K x O)`, and the actions for them, `(K x A)`.
    fn test_vectors(&self) -> (Vec<f32>, Vec<f32>) {
        let policy = self.policy();
        let mut hidden = vec![0.0; policy.network.workspace_len()];
        let (mut observations, mut actions) = (Vec::new(), vec![0.0; NUM_TEST_VECTORS * self.shape.output]);
        for (k, action) in actions.chunks_exact_mut(self.shape.output.max(1)).enumerate() {
            let spread = |i: usize| ((7 * i + 3 * k) % 9) as f32 * 0.5 - 2.0;
            let values = self.mean.iter().zip(&self.inverse_std).enumerate();
            let raw: Vec<f32> = values.map(|(i, (mean, inverse_std))| mean + spread(i) / inverse_std).collect();
            policy.act(&mut raw.clone(), &mut hidden, action);
            observations.extend(raw);
        }
        (observations, actions)
    }
}

impl MirrorCard {
    fn new(maps: &MirrorMaps) -> Self {
        let pairs = |components: &[Component]| components.iter().map(|c| (c.source, c.sign)).collect();
        Self { observation: pairs(maps.observation()), action: pairs(maps.action()), sine: maps.sine() }
    }

    /// None if it is no mirror.
    fn maps(&self) -> Option<MirrorMaps> {
        let components =
            |pairs: &[(usize, f32)]| pairs.iter().map(|&(source, sign)| Component { source, sign }).collect();
        MirrorMaps::from_components(components(&self.observation), components(&self.action), self.sine)
    }
}

impl PolicyCard {
    /// Describes a task.
    fn new(task: &Task, gait_name: &str, provenance: Provenance) -> Self {
        let controller = task.controller();
        let (gait, law) = (controller.gait(), controller.law());
        let legs = task.robot.legs.iter().map(|leg| {
            let (kind, upper_link_m, lower_link_m, hip_separation_m, knee_in_front) = match leg.geometry {
                LegGeometry::FiveBar(leg) => {
                    ("five-bar", leg.upper_link_m(), leg.lower_link_m(), leg.hip_separation_m(), false)
                }
                LegGeometry::Serial(leg) => {
                    ("serial", leg.upper_link_m(), leg.lower_link_m(), 0.0, leg.knee_in_front())
                }
            };
            LegCard {
                kind: kind.to_owned(),
                upper_link_m,
                lower_link_m,
                stance_length_m: leg.geometry.length(0.0),
                hip_separation_m,
                knee_in_front,
                joints: match leg.actuators {
                    Actuators::LegSpace => None,
                    Actuators::Joints(joints) => Some(joints.map(|joint| (joint.sign, joint.standing))),
                },
                swing_limits_rad: leg.limits.swing,
                extension_limits_rad: leg.limits.extension,
            }
        });
        let leg_gaits = gait.legs.iter().map(|leg| {
            let (waveform, waveform_parameters) = match leg.waveform {
                Waveform::Sine(sine) => ("sine", vec![sine.extension_phase]),
                Waveform::Stepping(stepping) => {
                    let p = stepping.parameters();
                    let numbers = vec![
                        p.stance_height_m,
                        p.down_amplitude_m,
                        p.up_amplitude_m,
                        p.flight_fraction,
                        p.step_length_m,
                    ];
                    ("stepping", numbers)
                }
                Waveform::Table(table) => {
                    ("table", table.wave().iter().flat_map(|leg| [leg.swing, leg.extension]).collect())
                }
            };
            let p = leg.defaults;
            LegGaitCard {
                waveform: waveform.to_owned(),
                waveform_parameters,
                phase_offset: leg.phase_offset,
                defaults: [p.swing_amplitude, p.extension_amplitude, p.swing_offset, p.extension_offset],
            }
        });
        let ranges = law.ranges;
        Self {
            format_version: FORMAT_VERSION,
            robot: RobotCard {
                name: task.robot.settings.name.clone(),
                fingerprint: format!("{:016x}", task.robot.fingerprint),
                control_dt_s: task.settings.control_dt_s,
                legs: legs.collect(),
            },
            gait: GaitCard {
                name: gait_name.to_owned(),
                stride_frequency_hz: gait.stride_frequency_hz,
                legs: leg_gaits.collect(),
            },
            action: ActionCard {
                modulation: law.modulation.name().to_owned(),
                authority: law.authority,
                ranges: [
                    ranges.frequency_factor,
                    ranges.swing_amplitude,
                    ranges.extension_amplitude,
                    ranges.swing_offset,
                    ranges.extension_offset,
                ]
                .map(|range| [range.low, range.high]),
                residual_bound_rad: (law.modulation == Modulation::Residual).then_some(law.residual_bound_rad),
            },
            observation: task.blocks().iter().map(|block| block.name().to_owned()).collect(),
            mirror: task.mirror_maps().map(MirrorCard::new),
            provenance,
        }
    }
}
