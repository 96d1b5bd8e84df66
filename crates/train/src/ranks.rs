//! Ranks: what the processes of one training tell each other besides samples and gradients.
//!
//! Rank 0 owns the files and speaks for all. It [`lead`]s: the others learn from it what is trained, and [`follow`]. Each
//! rank has the environments that [`own_part`](canter_learn::communicator::own_part) gives it.

use std::sync::Arc;

use canter_learn::communicator::{Communicator, Message, Received, exchange};
use canter_sim::settings::{Document, write_commented};

use crate::checkpoint::Checkpoint;
use crate::config::{Resolved, resolve};
use crate::trainer::Trainer;

/// Why ranks cannot train together.
#[derive(Debug, thiserror::Error)]
pub enum RanksError {
    /// There is not an environment for each.
    #[error(
        "{num_ranks} ranks were started for {num_environments} environments, and each needs one: start fewer, or raise \
         training.num_environments"
    )]
    TooMany {
        /// Ranks that were started.
        num_ranks: usize,
        /// Environments of the configuration.
        num_environments: usize,
    },
    /// Another rank cannot do its part.
    #[error("rank {rank}: {message}")]
    Rank {
        /// The rank.
        rank: usize,
        /// What it says.
        message: String,
    },
    /// The ranks are no longer equal.
    #[error(
        "rank {rank} has come to other parameters than rank 0; the ranks' processors must have the same features. What was \
         saved is good, go on on equal machines"
    )]
    Differ {
        /// The first rank that differs.
        rank: usize,
    },
}

/// This rank's part of a training that has not begun.
///
/// # Errors
/// There are more ranks than environments.
pub fn trainer(resolved: Resolved, communicator: Arc<dyn Communicator>) -> Result<Trainer, RanksError> {
    let (num_ranks, num_environments) = (communicator.num_ranks(), resolved.config.training.num_environments);
    if num_ranks > num_environments {
        return Err(RanksError::TooMany { num_ranks, num_environments });
    }
    Ok(Trainer::on_ranks(resolved, communicator))
}

/// On rank 0: tells the others what is trained, and from where on; with nothing, that there is nothing for them to do.
///
/// # Errors
/// One of the others cannot do its part.
pub fn lead(
    communicator: &dyn Communicator,
    start: Option<(&Resolved, Option<&Checkpoint>)>,
) -> Result<(), RanksError> {
    if communicator.num_ranks() == 1 {
        return Ok(());
    }
    let mut message = Message::default();
    if let Some((resolved, checkpoint)) = start {
        message.push_bytes(env!("CARGO_PKG_VERSION").as_bytes());
        message.push_u64(resolved.task.robot.fingerprint);
        message.push_bytes(write_commented(&resolved.config).as_bytes());
        message.push_bytes(&checkpoint.map(Checkpoint::to_bytes).unwrap_or_default());
    }
    tell(communicator, message.bytes());
    if start.is_some() { all_are_ready(communicator, "") } else { Ok(()) }
}

/// On rank 0: tells the others something, who [`hear`] it.
pub fn tell(communicator: &dyn Communicator, message: &[u8]) {
    exchange(communicator, message);
}

/// On the other ranks: what rank 0 [`tell`]s.
pub fn hear(communicator: &dyn Communicator) -> Vec<u8> {
    exchange(communicator, &[]).swap_remove(0)
}

/// On the other ranks: this rank's part of the training that rank 0 leads; none if there is none. Rank 0 says why.
pub fn follow(communicator: &Arc<dyn Communicator>) -> Option<Trainer> {
    let start = hear(&**communicator);
    if start.is_empty() {
        return None;
    }
    let trainer = prepare(&start, communicator);
    all_are_ready(&**communicator, trainer.as_ref().err().map_or("", String::as_str)).ok()?;
    trainer.ok()
}

/// This rank's part of what rank 0 has told.
fn prepare(start: &[u8], communicator: &Arc<dyn Communicator>) -> Result<Trainer, String> {
    let mut received = Received::new(start);
    if received.bytes() != env!("CARGO_PKG_VERSION").as_bytes() {
        return Err(format!("this canter is version {}, rank 0's is another", env!("CARGO_PKG_VERSION")));
    }
    let fingerprint = received.u64();
    let document = Document::parse("rank 0's configuration", received.bytes()).map_err(|error| error.to_string())?;
    let resolved = resolve(&document).map_err(|error| error.to_string())?;
    if resolved.task.robot.fingerprint != fingerprint {
        return Err(format!("the files of {} differ from those that rank 0 reads", resolved.config.robot));
    }
    let mut trainer = trainer(resolved, communicator.clone()).map_err(|error| error.to_string())?;
    let checkpoint = received.bytes();
    if !checkpoint.is_empty() {
        let checkpoint = Checkpoint::from_bytes(checkpoint).map_err(|error| error.to_string())?;
        checkpoint.restore(&mut trainer).map_err(|error| error.to_string())?;
    }
    Ok(trainer)
}

/// Waits until every rank has said what is wrong with it; nothing is `""`.
///
/// # Errors
/// What the first rank says that is not ready.
pub fn all_are_ready(communicator: &dyn Communicator, problem: &str) -> Result<(), RanksError> {
    let problems = exchange(communicator, problem.as_bytes());
    let first = problems.iter().enumerate().find(|(_, problem)| !problem.is_empty());
    first.map_or(Ok(()), |(rank, problem)| {
        Err(RanksError::Rank { rank, message: String::from_utf8_lossy(problem).into_owned() })
    })
}

/// Whether any rank says yes; every rank hears the same.
pub fn any(communicator: &dyn Communicator, own: bool) -> bool {
    communicator.num_ranks() > 1 && exchange(communicator, &[u8::from(own)]).concat().contains(&1) || own
}

/// Whether any rank was asked to stop, after an iteration.
///
/// # Errors
/// The ranks' parameters are not equal.
pub(crate) fn agree(trainer: &Trainer, is_stopped: bool) -> Result<bool, RanksError> {
    let communicator = trainer.communicator();
    if communicator.num_ranks() == 1 {
        return Ok(is_stopped);
    }
    let mut message = Message::default();
    message.push_u64(fingerprint(&trainer.parameters));
    message.push_u64(u64::from(is_stopped));
    let messages = exchange(communicator, message.bytes());
    let differs = |message: &Vec<u8>| message[..8] != messages[0][..8];
    match messages.iter().position(differs) {
        Some(rank) => Err(RanksError::Differ { rank }),
        None => Ok(messages.iter().any(|message| message[8..] != [0; 8])),
    }
}

/// A number that differs where one of the parameters does.
///
/// ```text
/// hash = (hash xor bits of the parameter) 1099511628211 mod 2^64,   for each parameter in turn
/// ```
///
/// Source: Fowler, Noll and Vo, FNV-1a with 64 bits, over words instead of bytes.
fn fingerprint(parameters: &[f32]) -> u64 {
    const BASIS: u64 = 0xcbf2_9ce4_8422_2325;
    const PRIME: u64 = 0x100_0000_01b3;
    parameters.iter().fold(BASIS, |hash, parameter| (hash ^ u64::from(parameter.to_bits())).wrapping_mul(PRIME))
}
