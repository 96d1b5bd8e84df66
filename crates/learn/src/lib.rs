//! PPO as mathematics: what is learned from, how good each step was, and how the parameters change.
//!
//! One iteration, top to bottom:
//!
//! 1. **Collect** ([`collect`]): every [`environment::Environment`] is stepped T times with the current policy
//!    `a ~ N(mean(o), std^2)` ([`gaussian`]); observations are standardised with the statistics of the iterations
//!    before ([`normaliser`]). The samples are a [`rollout::Rollout`].
//! 2. **Values** ([`advantage::compute_values`]): `V(o)` of every observation, in blocks ([`network`]). What follows an
//!    accident is worth 0; what follows a limit is worth the value of the episode's last observation.
//! 3. **Advantages** ([`advantage::estimate_advantages`]): the paper's `A = r + gamma V(s') - V(s)`
//!    ([`advantage::one_step_advantage`]), or its exponentially weighted sum over the steps that follow
//!    ([`advantage::generalised_advantage`]); `returns = advantages + values`.
//! 4. **Update** ([`ppo::update`]): for each epoch and minibatch the gradient ([`loss::loss_and_gradient`]) of
//!
//!    ```text
//!    loss = mean( -min(r A, clip(r, 1 - epsilon, 1 + epsilon) A) + c_v 1/2 (V - R)^2 - c_e H )
//!    r = exp(ln p - ln p_old)
//!    ```
//!
//!    - the ratio `r`: [`loss::ratio`]; the paper's eq. 2: [`loss::surrogate_unclipped`]; its eq. 3:
//!      [`loss::surrogate_clipped`]
//!    - the critic's `1/2 (V - R)^2`: [`loss::value_loss`]; the entropy `H`: [`gaussian::DiagonalGaussian::entropy`]
//!    - the gradient's limit: [`ppo::limit_norm`]; the step: [`adam::Adam::step`]; the learning rate:
//!      [`ppo::adapted_learning_rate`]
//!
//! Several processes can do this together ([`communicator`]): each collects with environments of its own and computes
//! its own part of every gradient.
//!
//! Every gradient is written by hand for `f32` and `f64` alike ([`real::Real`]); tests hold the `f64` one to central
//! differences. The crate starts no thread, reads no clock or file and prints nothing: its caller brings the threads
//! ([`executor::Executor`]). Each random number belongs to a stream named by four numbers ([`random::stream`]), and
//! sums are added in a fixed order, so the same seed gives the same bytes on any number of threads and processes.
//!
//! Source: Hu et al., "Learning a Faster Locomotion Gait for a Quadruped Robot with Model-Free Deep Reinforcement
//! Learning" (the paper), section II; Schulman et al. 2016 (GAE); Schulman et al. 2017 (PPO).

pub mod adam;
pub mod advantage;
pub mod collect;
pub mod communicator;
pub mod environment;
pub mod executor;
pub mod gaussian;
pub mod loss;
mod matrix;
pub mod metrics;
pub mod network;
pub mod normaliser;
pub mod policy;
pub mod ppo;
pub mod random;
pub mod real;
pub mod rollout;
pub mod settings;
mod shard;
mod simd;

pub use adam::Adam;
pub use advantage::{compute_values, estimate_advantages};
pub use collect::{
    CollectorState, EpisodeRecord, Forward, OngoingEpisode, PORTABLE_FORWARD, PolicyView, collect_column,
};
pub use communicator::{Alone, Communicator};
pub use environment::{Environment, StepOutcome};
pub use executor::{Executor, Serial, for_each_mut};
pub use metrics::UpdateMetrics;
pub use normaliser::{Normaliser, RunningMoments};
pub use policy::ActorCritic;
pub use ppo::{Divergence, PpoWorkspace, UpdateContext, update};
pub use random::{Purpose, stream};
pub use rollout::{Rollout, RolloutColumn};
pub use settings::{Objective, PpoSettings};
