//! A window in which a robot moves: mujoco-rs's viewer, with the feature `view`.

use std::error::Error;

use mujoco_rs::viewer::{MjViewer, MjViewerError};
use mujoco_rs::wrappers::mj_data::MjData;
use mujoco_rs::wrappers::mj_model::MjModel;

use crate::render::Pose;
use crate::robot::Robot;

/// Why there is no window, or no longer.
#[derive(Debug, thiserror::Error)]
pub enum ViewError {
    /// Neither of the variables that name a screen is set.
    #[error("there is no screen: neither DISPLAY nor WAYLAND_DISPLAY is set")]
    NoScreen,
    /// The screen that they name does not answer.
    #[error("the screen that DISPLAY or WAYLAND_DISPLAY names does not answer")]
    NoAnswer,
    /// What the viewer said.
    #[error("{}", with_sources(.0))]
    Viewer(#[source] MjViewerError),
}

/// An error and what it came from, in one line.
fn with_sources(error: &dyn Error) -> String {
    let sources = std::iter::successors(Some(error), |&error| error.source());
    sources.map(ToString::to_string).collect::<Vec<_>>().join(": ")
}

/// A window with a robot. It shows poses and simulates nothing.
#[derive(Debug)]
pub struct Viewer {
    window: MjViewer,
    data: MjData<Box<MjModel>>,
}

impl Viewer {
    /// Opens a window; it belongs to the thread that opened it, which has to be the program's first.
    ///
    /// # Errors
    /// There is no screen, or nothing on it can be drawn with OpenGL.
    pub fn open(robot: &Robot, title: &str) -> Result<Self, ViewError> {
        let is_set = |name: &str| std::env::var_os(name).is_some_and(|value| !value.is_empty());
        if !is_set("DISPLAY") && !is_set("WAYLAND_DISPLAY") {
            return Err(ViewError::NoScreen);
        }
        let data = MjData::new(Box::new(robot.model.raw().clone()));
        let window = MjViewer::builder().window_name(title.to_owned()).build_passive(data.model());
        let window = window.map_err(|error| match error {
            MjViewerError::EventLoopError(_) => ViewError::NoAnswer,
            error => ViewError::Viewer(error),
        })?;
        Ok(Self { window, data })
    }

    /// Shows the robot in a pose and does what the user asks of the window. Returns whether it is still open.
    ///
    /// # Errors
    /// The window cannot be drawn any more.
    pub fn show(&mut self, pose: &Pose) -> Result<bool, ViewError> {
        if self.window.running() {
            self.data.qpos_mut().copy_from_slice(pose.qpos());
            self.data.forward();
            self.window.sync_data(&mut self.data);
            self.window.render().map_err(ViewError::Viewer)?;
        }
        Ok(self.window.running())
    }
}
