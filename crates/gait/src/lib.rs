//! What runs on the robot: everything between its sensors and its actuator targets.
//!
//! The simulator calls this very code, so a policy that trains well cannot differ from the one that is deployed.
//! One control step reads top to bottom in [`controller::Controller::step`]:
//!
//! 1. [`observation`]: sensors, phase and previous action become the observation;
//! 2. [`mirror`], [`normaliser`], [`network`]: the policy's action, each component in [-1, 1];
//! 3. [`action`]: the action and the `authority` become gait parameters (the paper's eq. 4 and 5);
//! 4. [`prior`]: the gait with these parameters at the current [`phase`] becomes a leg position;
//! 5. [`kinematics`]: limits, then actuator targets.
//!
//! [`runtime`] is what a robot does around that: it ramps in from standing, stops, and holds its pose without sensors.
//!
//! There is no allocation, no `std` and no global state here, and nothing that runs once a step can panic: steps iterate
//! over what there is, so a slice that is too short shortens the result.
#![no_std]
#![forbid(unsafe_code)]

pub mod action;
pub mod controller;
pub mod kinematics;
pub mod mirror;
pub mod network;
pub mod normaliser;
pub mod observation;
pub mod phase;
pub mod prior;
pub mod runtime;
pub mod tanh;

pub use action::{ActionLaw, Modulation, ParameterRanges, Range};
pub use controller::{Controller, Policy, Workspace};
pub use kinematics::{
    Actuators, FiveBar, FootPosition, JointConvention, Leg, LegGeometry, LegLimits, LegPosition, SerialLeg,
};
pub use mirror::Mirror;
pub use network::{Network, NetworkShape};
pub use normaliser::Normaliser;
pub use observation::{ObservationBlock, Sensors};
pub use phase::PhaseClock;
pub use prior::{Gait, LegGait, LegParameters, SineWave, Stepping, SteppingParameters, Waveform};
pub use runtime::{Memory, Mode, Reading, Runtime, RuntimeSettings};
