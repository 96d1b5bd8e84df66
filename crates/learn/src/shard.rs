//! A shard: the part of a minibatch whose gradient one thread computes.

use crate::communicator::{Message, Received};
use crate::loss::{LossSums, LossWorkspace, Samples, loss_and_gradient};
use crate::policy::ActorCritic;
use crate::rollout::Rollout;
use crate::settings::PpoSettings;

/// Most samples of a shard. It is fixed, so that the bytes of a gradient do not depend on the number of threads. A
/// shard's hidden layers fit into the second-level cache; smaller shards cost more for adding up their gradients.
pub(crate) const MAX_ROWS: usize = 128;

/// Samples gathered from a rollout, and the gradient of their loss.
#[derive(Clone, Debug)]
pub(crate) struct Shard {
    observations: Vec<f32>,
    actions: Vec<f32>,
    old_log_probs: Vec<f32>,
    advantages: Vec<f32>,
    returns: Vec<f32>,
    workspace: LossWorkspace<f32>,
    sums: LossSums,
}

impl Shard {
    /// An empty shard with room for [`MAX_ROWS`] samples.
    pub(crate) fn new(model: &ActorCritic) -> Self {
        Self {
            observations: Vec::with_capacity(MAX_ROWS * model.num_observations()),
            actions: Vec::with_capacity(MAX_ROWS * model.num_actions()),
            old_log_probs: Vec::with_capacity(MAX_ROWS),
            advantages: Vec::with_capacity(MAX_ROWS),
            returns: Vec::with_capacity(MAX_ROWS),
            workspace: LossWorkspace::new(model, MAX_ROWS),
            sums: LossSums::default(),
        }
    }

    /// Copies the samples at `indices`; `advantages` replace the rollout's own.
    pub(crate) fn gather(&mut self, rollout: &Rollout, advantages: &[f32], indices: &[u32]) {
        gather_rows(&mut self.observations, &rollout.observations, rollout.num_observations(), indices);
        gather_rows(&mut self.actions, &rollout.actions, rollout.num_actions(), indices);
        gather_rows(&mut self.old_log_probs, &rollout.log_probs, 1, indices);
        gather_rows(&mut self.advantages, advantages, 1, indices);
        gather_rows(&mut self.returns, &rollout.returns, 1, indices);
    }

    /// Computes the loss of the gathered samples and its gradient.
    pub(crate) fn compute_gradient(&mut self, model: &ActorCritic, parameters: &[f32], settings: &PpoSettings) {
        let samples = Samples {
            observations: &self.observations,
            actions: &self.actions,
            old_log_probs: &self.old_log_probs,
            advantages: &self.advantages,
            returns: &self.returns,
        };
        self.sums = loss_and_gradient(model, parameters, &samples, settings, &mut self.workspace);
    }

    /// Gradient of the samples' summed loss.
    pub(crate) fn gradient(&self) -> &[f32] {
        &self.workspace.d_loss_d_parameters
    }

    /// Bytes of what [`write`](Self::write) appends.
    pub(crate) fn num_bytes(&self) -> usize {
        LossSums::NUM_BYTES + size_of_val(self.gradient())
    }

    /// Appends gradient and sums, for the other ranks.
    pub(crate) fn write(&self, message: &mut Message) {
        self.sums.write(message);
        message.push_f32s(self.gradient());
    }

    /// Takes over the gradient and the sums that another rank has computed.
    pub(crate) fn read(&mut self, received: &mut Received<'_>) {
        self.sums = LossSums::read(received);
        received.f32s(&mut self.workspace.d_loss_d_parameters);
    }

    /// Sums of the samples' losses.
    pub(crate) fn sums(&self) -> &LossSums {
        &self.sums
    }
}

/// Replaces `target` by the rows of `source` at `indices`.
fn gather_rows(target: &mut Vec<f32>, source: &[f32], width: usize, indices: &[u32]) {
    target.clear();
    for &index in indices {
        let start = index as usize * width;
        target.extend_from_slice(&source[start..start + width]);
    }
}
