//! A URDF as an MJCF, which can say what a URDF cannot.

use std::path::Path;

use mujoco_rs::error::MjEditError;
use mujoco_rs::wrappers::mj_editing::MjSpec;

use super::keep_messages;

/// The MJCF that says the same as the URDF at `path`; names of meshes are as there.
///
/// # Errors
/// MuJoCo's own words about what is wrong with it.
pub fn urdf_to_mjcf(path: &Path) -> Result<String, String> {
    /// Most robots have less; MuJoCo says how much it needs.
    const USUAL_BYTES: usize = 1 << 16;
    keep_messages();
    let words = |error: MjEditError| error.to_string();
    let mut spec = MjSpec::from_xml(path).map_err(words)?;
    // Only what is compiled can be saved.
    spec.compile().map_err(words)?;
    match spec.save_xml_string(USUAL_BYTES) {
        Err(MjEditError::XmlBufferTooSmall { required_size }) => spec.save_xml_string(required_size + 1).map_err(words),
        other => other.map_err(words),
    }
}
