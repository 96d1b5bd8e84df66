//! What was learned leaves the simulator in the robot's own terms.
//!
//! [`exported`] resolves a policy file and its robot into what every format needs. [`c`], [`rust`] and [`onnx`] write the
//! whole controller, [`table`] its gait in open loop, [`fitted`] the nearest gait of few parameters. [`replay`] walks the exported thing in the simulator, [`safety`] holds
//! what it did against the robot's limits, and [`certificate`] says so beside the file.

pub mod c;
pub mod certificate;
pub mod exported;
pub mod fitted;
mod numbers;
pub mod onnx;
pub mod protocol;
pub mod replay;
pub mod rust;
pub mod safety;
pub mod table;

pub use certificate::{Candidate, Certificate, Walked, certify};
pub use exported::Exported;
pub use safety::Thresholds;
