//! The tuned gait: the best constant action that a search finds, what a hand could reach without learning.
//!
//! [`tuned`] searches the actions of a task with [`cma_es`], whose mathematics stands alone.

pub mod cma_es;
pub mod eigen;
pub mod tuned;
