//! Ranks: copies of this program that mpirun has started to train together. Rank 0 writes and speaks for all.

use std::sync::Arc;

#[cfg(not(feature = "mpi"))]
use canter_learn::communicator::Alone;
use canter_learn::communicator::Communicator;
#[cfg(feature = "mpi")]
use canter_train::world::World;
use serde_json::{Map, Value};

use crate::args::Command;
use crate::error::CliError;
#[cfg(feature = "mpi")]
use crate::output::{ERROR, complain};

/// What a training says at the first signal.
#[cfg_attr(not(feature = "mpi"), expect(dead_code, reason = "without MPI there is one rank"))]
const STOPPING_RANKS: &str = "\nstopping after this iteration, if mpirun waits as long; if not, the run goes on from its \
                              last checkpoint";

/// Where the launchers of MPI leave the number of copies and the number of each: Open MPI, MPICH and its kin.
const LAUNCHERS: [[&str; 2]; 2] = [["OMPI_COMM_WORLD_SIZE", "OMPI_COMM_WORLD_RANK"], ["PMI_SIZE", "PMI_RANK"]];

/// How this copy was started.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Launch {
    /// Copies that were started.
    num_ranks: usize,
    /// Which of them this is.
    rank: usize,
}

impl Launch {
    /// What the environment says; none without a launcher.
    pub fn of_this_process() -> Option<Self> {
        Self::of(|variable| std::env::var(variable).ok())
    }

    fn of(variable: impl Fn(&str) -> Option<String>) -> Option<Self> {
        LAUNCHERS.iter().find_map(|[size, rank]| {
            let number = |name: &str| variable(name)?.parse().ok();
            Some(Self { num_ranks: number(size)?, rank: number(rank).unwrap_or(0) })
        })
    }

    /// Whether another copy says what there is to say.
    pub fn is_silent(self) -> bool {
        self.rank > 0
    }

    /// Refuses what several copies of this program must not do side by side.
    pub fn check(self, command: &Command) -> Result<(), CliError> {
        let is_for_ranks = match command {
            Command::Train(_) | Command::Resume(_) | Command::Compare(_) => true,
            // It is started by a rank, whose environment it has.
            Command::CompileModel(_) => return Ok(()),
            _ => false,
        };
        if self.num_ranks == 1 {
            Ok(())
        } else if !is_for_ranks {
            Err(CliError::OneProcess(self.num_ranks))
        } else if !cfg!(feature = "mpi") {
            Err(CliError::NoMpi { num_ranks: self.num_ranks })
        } else {
            Ok(())
        }
    }
}

/// The ranks that work together.
#[derive(Debug)]
pub struct Ranks {
    /// How they tell each other.
    pub communicator: Arc<dyn Communicator>,
    #[cfg(feature = "mpi")]
    world: Option<Arc<World>>,
}

/// The world that this process is in, for the end that nobody expected.
#[cfg(feature = "mpi")]
static WORLD: std::sync::OnceLock<Arc<World>> = std::sync::OnceLock::new();

#[cfg(not(feature = "mpi"))]
impl Ranks {
    /// This process alone.
    pub fn enter() -> Result<Self, CliError> {
        Ok(Self { communicator: Arc::new(Alone) })
    }

    /// Waits until all ranks leave.
    pub fn leave(&self) {}

    /// What is said at the first signal, where one process says `notice`.
    pub fn stopping(&self, notice: &'static str) -> &'static str {
        notice
    }

    /// What `run.json` says of the exchange.
    fn traffic(&self) -> Map<String, Value> {
        Map::new()
    }
}

#[cfg(feature = "mpi")]
impl Ranks {
    /// All that mpirun has started; this process alone if there was none.
    pub fn enter() -> Result<Self, CliError> {
        use canter_learn::communicator::Alone;
        // Slurm's own launcher may leave nothing but this one.
        let is_launched = Launch::of_this_process().is_some() || std::env::var_os("PMIX_RANK").is_some();
        if !is_launched {
            return Ok(Self { communicator: Arc::new(Alone), world: None });
        }
        let world = Arc::new(World::enter()?);
        if WORLD.set(world.clone()).is_ok() {
            let rank = world.rank();
            world.abort_on_panic(move || {
                complain(&format!("{ERROR}this was rank {rank}, without which the others cannot go on"));
            });
        }
        Ok(Self { communicator: world.clone(), world: Some(world) })
    }

    /// Waits until all ranks leave. Rank 0 goes on as an ordinary process.
    pub fn leave(&self) {
        if let Some(world) = &self.world {
            world.leave();
        }
    }

    /// What is said at the first signal, where one process says `notice`: nothing on all ranks but 0.
    pub fn stopping(&self, notice: &'static str) -> &'static str {
        match (self.communicator.num_ranks(), self.communicator.rank()) {
            (1, _) => notice,
            (_, 0) => STOPPING_RANKS,
            _ => "",
        }
    }

    /// What `run.json` says of the exchange.
    fn traffic(&self) -> Map<String, Value> {
        let mut traffic = Map::new();
        if let Some(world) = self.world.as_ref().filter(|_| self.communicator.num_ranks() > 1) {
            traffic.insert("received_bytes".to_owned(), world.received_bytes().into());
            traffic.insert("exchange_s".to_owned(), world.exchange_s().into());
        }
        traffic
    }
}

impl Ranks {
    /// Whether this rank works for rank 0, which speaks.
    pub fn is_follower(&self) -> bool {
        self.communicator.rank() > 0
    }

    /// The number of threads that was asked for, or what there is without: one for each rank, all cores for a process alone.
    pub fn threads(&self, asked: Option<u16>) -> Option<u16> {
        if self.communicator.num_ranks() > 1 { asked.or(Some(1)) } else { asked }
    }

    /// Who works, for a message.
    pub fn describe(&self, num_threads: usize) -> String {
        match self.communicator.num_ranks() {
            1 => format!("{num_threads} threads"),
            num_ranks => format!("{num_ranks} ranks x {num_threads} threads"),
        }
    }

    /// What `run.json` says of the ranks.
    pub fn card(&self) -> Map<String, Value> {
        let mut card = self.traffic();
        card.insert("ranks".to_owned(), self.communicator.num_ranks().into());
        card
    }
}

/// Which rank this process is.
#[cfg(feature = "mpi")]
pub fn rank() -> usize {
    WORLD.get().map_or(0, |world| world.rank())
}

/// Which rank this process is.
#[cfg(not(feature = "mpi"))]
pub fn rank() -> usize {
    0
}

/// Ends the other ranks, which would wait for this one in vain; nothing happens once they have been left.
pub fn end_all() {
    #[cfg(feature = "mpi")]
    if let Some(world) = WORLD.get() {
        world.abort(i32::from(crate::error::FAILURE));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn launchers_are_known_by_what_they_leave() {
        let launch = |variables: &[(&str, &str)]| {
            Launch::of(|name| variables.iter().find(|(known, _)| *known == name).map(|(_, value)| (*value).to_owned()))
        };
        let open_mpi = [("OMPI_COMM_WORLD_SIZE", "3"), ("OMPI_COMM_WORLD_RANK", "2"), ("PMI_SIZE", "7")];
        assert_eq!(launch(&open_mpi), Some(Launch { num_ranks: 3, rank: 2 }));
        assert_eq!(launch(&[("PMI_SIZE", "1"), ("PMI_RANK", "0")]), Some(Launch { num_ranks: 1, rank: 0 }));
        assert_eq!(launch(&[("PMI_SIZE", "many"), ("PMI_RANK", "0")]), None);
        assert_eq!(launch(&[("SLURM_NTASKS", "4")]), None);
    }
}
