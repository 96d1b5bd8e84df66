//! Ranks that are threads of the test: everything about ranks but the network.

use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex};
use std::thread;

use canter_learn::communicator::{Communicator, part};

/// One of several threads that tell each other bytes.
#[derive(Debug)]
struct ThreadRank {
    rank: usize,
    /// To each rank, this one included.
    senders: Vec<Sender<Vec<u8>>>,
    /// From each rank. One that panics closes its channels, so that nobody waits for it.
    receivers: Vec<Mutex<Receiver<Vec<u8>>>>,
}

impl Communicator for ThreadRank {
    fn num_ranks(&self) -> usize {
        self.senders.len()
    }

    fn rank(&self) -> usize {
        self.rank
    }

    fn all_gather(&self, own: &[u8], lengths: &[usize], all: &mut [u8]) {
        assert_eq!(own.len(), lengths[self.rank]);
        self.senders.iter().for_each(|sender| sender.send(own.to_vec()).unwrap());
        let received: Vec<Vec<u8>> =
            self.receivers.iter().map(|receiver| receiver.lock().unwrap().recv().unwrap()).collect();
        assert!(received.iter().map(Vec::len).eq(lengths.iter().copied()), "all ranks are at the same place");
        all.copy_from_slice(&received.concat());
    }
}

/// Runs `work` once on each of `num_ranks` ranks and returns what they return, in their order.
pub fn on_ranks<R: Send>(num_ranks: usize, work: impl Fn(Arc<dyn Communicator>) -> R + Sync) -> Vec<R> {
    // Channel number a R + b goes from rank a to rank b.
    let (senders, receivers): (Vec<_>, Vec<_>) = (0..num_ranks * num_ranks).map(|_| channel()).unzip();
    let mut receivers: Vec<_> = receivers.into_iter().map(|receiver| Some(Mutex::new(receiver))).collect();
    let mut ranks = Vec::new();
    for rank in 0..num_ranks {
        let senders = senders[part(num_ranks * num_ranks, num_ranks, rank)].to_vec();
        let receivers = (0..num_ranks).map(|from| receivers[from * num_ranks + rank].take().unwrap()).collect();
        ranks.push(ThreadRank { rank, senders, receivers });
    }
    drop(senders);
    thread::scope(|scope| {
        let work = &work;
        let threads: Vec<_> = ranks.into_iter().map(|rank| scope.spawn(move || work(Arc::new(rank)))).collect();
        threads.into_iter().map(|thread| thread.join().unwrap()).collect()
    })
}
