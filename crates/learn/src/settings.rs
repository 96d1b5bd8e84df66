//! The learner's settings.

/// Which surrogate of the policy's improvement is maximised.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Objective {
    /// The paper's eq. 3: [`surrogate_clipped`](crate::loss::surrogate_clipped).
    Clipped,
    /// The paper's eq. 2: [`surrogate_unclipped`](crate::loss::surrogate_unclipped).
    Unclipped,
}

/// Settings of PPO. All are dimensionless.
#[derive(Clone, Debug, PartialEq)]
pub struct PpoSettings {
    /// Discount per environment step, in [0, 1]. Larger looks further ahead and makes values harder to learn.
    /// Default 0.99 (Schulman et al. 2017, table 3).
    pub gamma: f64,
    /// Trace decay of the generalised advantage estimate, in [0, 1]: 0 is the paper's one-step advantage (little
    /// variance, biased by the critic), 1 the discounted return (the reverse). Default 0.95 (Schulman et al. 2017,
    /// table 3).
    pub gae_lambda: f64,
    /// How far the probability ratio may leave 1 before the clipped objective ignores the gain, in (0, 1).
    /// Larger learns faster and less safely. Default 0.2 (Schulman et al. 2017, table 1).
    pub clip_epsilon: f64,
    /// Which surrogate is maximised. Default clipped (the paper's eq. 3).
    pub objective: Objective,
    /// Passes over one rollout, at least 1. More uses samples better and strays further from the policy that
    /// collected them. Default 5 (rsl_rl).
    pub num_epochs: usize,
    /// Samples per gradient step, at least 1. A rollout that is not a whole number of minibatches is cut into equal
    /// ones of the nearest size. Larger gives less noise and fewer steps. Default 512.
    pub minibatch_size: usize,
    /// Adam's step size at the start of training, above 0. Default 3e-4 (Schulman et al. 2017, table 3).
    pub learning_rate: f64,
    /// Weight of the value loss, at least 0. Actor and critic share no parameters, so it matters through the
    /// gradient's limit only. Default 1 (rsl_rl).
    pub value_coefficient: f64,
    /// Weight of the entropy bonus, at least 0. Larger explores longer. Default 0 (Schulman et al. 2017, continuous
    /// control).
    pub entropy_coefficient: f64,
    /// Limit of the Euclidean norm of the whole gradient, above 0. Default 1 (rsl_rl).
    pub max_gradient_norm: f64,
    /// If set, the learning rate follows this approximate KL divergence between old and new policy, above 0:
    /// [`adapted_learning_rate`](crate::ppo::adapted_learning_rate). Default 0.01 (rsl_rl).
    pub target_kl: Option<f64>,
    /// Whether the rollout's advantages are shifted and scaled to mean 0 and standard deviation 1, which makes the
    /// gradient independent of the reward's scale. Default true (rsl_rl).
    pub normalise_advantages: bool,
}

impl Default for PpoSettings {
    fn default() -> Self {
        Self {
            gamma: 0.99,
            gae_lambda: 0.95,
            clip_epsilon: 0.2,
            objective: Objective::Clipped,
            num_epochs: 5,
            minibatch_size: 512,
            learning_rate: 3e-4,
            value_coefficient: 1.0,
            entropy_coefficient: 0.0,
            max_gradient_norm: 1.0,
            target_kl: Some(0.01),
            normalise_advantages: true,
        }
    }
}
