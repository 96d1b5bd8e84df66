//! Typed TOML files: robots and presets.
//!
//! A configuration is declared once, with [`settings!`](crate::settings!), [`choices!`](crate::choices!) and
//! [`tagged!`](crate::tagged!); reading, checking, describing and writing all derive from that declaration.
//!
//! ```
//! use canter_sim::settings;
//! use canter_sim::settings::Document;
//!
//! settings! {
//!     /// Proximal policy optimisation.
//!     pub struct PpoSettings {
//!         /// Discount factor per env step.
//!         pub gamma: f64 in 0.0..=1.0,
//!         /// Passes over one rollout.
//!         pub num_epochs: u32 in 1..=100,
//!     }
//! }
//!
//! let mut document = Document::parse("ppo.toml", b"gamma = 1.5\nnum_epochs = 5\n").unwrap();
//! let problems = document.read::<PpoSettings>().unwrap_err();
//! assert_eq!(
//!     problems.to_string(),
//!     "ppo.toml:1:9: gamma = 1.5 is out of range: expected a number from 0 to 1"
//! );
//! document.set("gamma", "0.99");
//! assert_eq!(document.read::<PpoSettings>().unwrap().gamma, 0.99);
//! ```
//!
//! The way of the data: bytes -> [`Document`] (a tree in which every value knows where it was written) ->
//! [`Setting::read`] -> the struct, or [`Problems`]: everything wrong with the file, each with its position.
//! There are no defaults and nothing is inherited: a missing key is an error unless its type is an `Option`.

mod document;
mod limits;
mod macros;
mod problems;
mod setting;
mod shape;
mod tree;
mod write;

#[cfg(test)]
mod tests;

pub use document::Document;
pub(crate) use document::MAX_FILE_BYTES;
pub use limits::{Limits, above};
pub use problems::{Place, Problem, ProblemKind, Problems};
pub use setting::{Node, Setting};
pub use shape::{Choice, Description, Field, Shape, describe};
pub use write::{Output, write_commented, write_plain};
