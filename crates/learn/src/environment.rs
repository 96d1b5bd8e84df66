//! What the learner needs to know of an environment.

/// What one environment step gave.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StepOutcome {
    /// Reward of the step.
    pub reward: f32,
    /// The episode ended in an accident: nothing follows, and no value is added.
    pub terminated: bool,
    /// The episode was cut by the time limit or the goal distance: the value of what would have followed is added.
    pub truncated: bool,
}

/// One environment. It draws its own starts, so that it can be stepped on any thread.
pub trait Environment: Send {
    /// Length of an observation, O.
    fn num_observations(&self) -> usize;

    /// Length of an action, A.
    fn num_actions(&self) -> usize;

    /// Starts a new episode and writes its first observation, not normalised.
    ///
    /// # Shapes
    /// - `observation`: `(O)`
    fn reset(&mut self, observation: &mut [f32]);

    /// Applies an action for one environment step and writes the observation after it, not normalised.
    ///
    /// It never resets by itself: after a terminated or truncated step the caller sees the episode's last
    /// observation, and resets.
    ///
    /// # Shapes
    /// - `action`: `(A)`, each component in [-1, 1]
    /// - `observation`: `(O)`
    fn step(&mut self, action: &[f32], observation: &mut [f32]) -> StepOutcome;
}
