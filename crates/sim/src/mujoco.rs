//! The one place that names MuJoCo: loading a model, stepping it, reading and restoring its state, and drawing it.

pub mod anatomy;
mod changes;
pub mod convert;
pub mod painter;
mod relief;
#[cfg(feature = "view")]
pub mod viewer;

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, Once, OnceLock, PoisonError};

use mujoco_rs::error::MjModelError;
use mujoco_rs::mujoco_c::{mjtState, mjtWarning};
use mujoco_rs::wrappers::mj_data::MjData;
use mujoco_rs::wrappers::mj_logging::{MjLogMessage, MjtLogLevel};
use mujoco_rs::wrappers::mj_model::{MjModel, MjtGeomBase, MjtJoint, MjtObjBase};

/// What identifies an object of the model by its name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ObjectKind {
    /// A body.
    Body,
    /// A joint.
    Joint,
    /// A geom.
    Geom,
    /// An actuator.
    Actuator,
}

impl ObjectKind {
    fn to_mujoco(self) -> MjtObjBase {
        match self {
            Self::Body => MjtObjBase::mjOBJ_BODY,
            Self::Joint => MjtObjBase::mjOBJ_JOINT,
            Self::Geom => MjtObjBase::mjOBJ_GEOM,
            Self::Actuator => MjtObjBase::mjOBJ_ACTUATOR,
        }
    }
}

/// MuJoCo's warnings and errors that nobody has taken yet; it would otherwise write a log file into the working directory.
static MESSAGES: Mutex<Vec<String>> = Mutex::new(Vec::new());

/// At most this many of MuJoCo's messages are kept.
const MAX_MESSAGES: usize = 100;

/// Told what MuJoCo cannot go on after, before it ends the process.
static FATAL_HANDLER: OnceLock<fn(&str)> = OnceLock::new();

/// Has `handler` told MuJoCo's last words when it ends the process, with exit code 1, for example because there is no
/// memory; a second call changes nothing. Without a handler they are lost.
pub fn set_fatal_handler(handler: fn(&str)) {
    // The first handler stays.
    let _ = FATAL_HANDLER.set(handler);
}

fn keep_message(message: &MjLogMessage) {
    if let (MjtLogLevel::mjLOG_ERROR, Some(handler)) = (message.level(), FATAL_HANDLER.get()) {
        handler(message.subject());
    }
    // MuJoCo also tells how long it compiled.
    if !matches!(message.level(), MjtLogLevel::mjLOG_WARNING | MjtLogLevel::mjLOG_ERROR) {
        return;
    }
    let mut messages = MESSAGES.lock().unwrap_or_else(PoisonError::into_inner);
    if messages.len() < MAX_MESSAGES {
        messages.push(message.subject().to_owned());
    }
}

/// Sends MuJoCo's messages to [`MESSAGES`], from the first call on.
fn keep_messages() {
    static INSTALLED: Once = Once::new();
    INSTALLED.call_once(|| {
        // SAFETY: every model is loaded by way of this function, so no thread of ours can use MuJoCo before the first call ends.
        unsafe { mujoco_rs::logging::set_log_handler(keep_message) };
    });
}

/// Takes what MuJoCo has said since the last call, at most the first 100 messages.
pub fn take_messages() -> Vec<String> {
    std::mem::take(&mut *MESSAGES.lock().unwrap_or_else(PoisonError::into_inner))
}

/// MuJoCo's own words of an error.
fn message_of(error: &MjModelError) -> String {
    match error {
        MjModelError::LoadFailed(message) => message.trim().to_owned(),
        other => other.to_string(),
    }
}

/// A compiled MuJoCo model.
#[derive(Clone, Debug)]
pub struct Model {
    compiled: MjModel,
    /// `(nq)` the standing pose.
    standing: Vec<f64>,
    source: Source,
}

/// What a model was compiled from.
#[derive(Clone, Debug)]
enum Source {
    File(PathBuf),
    Text(Arc<str>),
}

impl Model {
    fn new(compiled: MjModel, source: Source) -> Self {
        Self { standing: compiled.qpos0().to_vec(), compiled, source }
    }

    /// Compiles the MJCF or URDF at `path`.
    ///
    /// # Errors
    /// MuJoCo's own words about what is wrong with the file.
    pub fn load(path: &Path) -> Result<Self, String> {
        keep_messages();
        MjModel::from_xml(path)
            .map(|compiled| Self::new(compiled, Source::File(path.to_owned())))
            .map_err(|error| message_of(&error))
    }

    /// Compiles a model that is text: MJCF without other files.
    ///
    /// # Errors
    /// MuJoCo's own words about what is wrong with it.
    pub fn parse(text: &str) -> Result<Self, String> {
        keep_messages();
        MjModel::from_xml_string(text)
            .map(|compiled| Self::new(compiled, Source::Text(text.into())))
            .map_err(|error| message_of(&error))
    }

    /// The number of the object of this name.
    pub fn id(&self, kind: ObjectKind, name: &str) -> Option<usize> {
        // MuJoCo's names end at their first NUL, so none has one.
        (!name.contains('\0')).then(|| self.compiled.name_to_id(kind.to_mujoco(), name))?
    }

    /// How many there are of what costs memory and time: name and number.
    pub fn sizes(&self) -> [(&'static str, usize); 8] {
        let sizes = self.compiled.ffi();
        [
            ("bodies", sizes.nbody),
            ("degrees of freedom", sizes.nv),
            ("geoms", sizes.ngeom),
            ("sites", sizes.nsite),
            ("tendons", sizes.ntendon),
            ("actuators", sizes.nu),
            ("equality constraints", sizes.neq),
            ("sensors", sizes.nsensor),
        ]
        .map(|(name, number)| (name, number as usize))
    }

    /// Memory for contacts and constraints that each simulation reserves [B].
    pub fn arena_bytes(&self) -> usize {
        self.compiled.ffi().narena as usize
    }

    /// The total mass [kg].
    pub fn total_mass_kg(&self) -> f64 {
        self.compiled.totalmass()
    }

    /// Magnitude of gravity [m/s^2].
    pub fn gravity(&self) -> f64 {
        self.compiled.opt().gravity.iter().map(|component| component * component).sum::<f64>().sqrt()
    }

    /// Where the joint's position and velocity stand in `qpos` and `qvel`.
    pub fn joint_addresses(&self, joint: usize) -> (usize, usize) {
        (self.compiled.jnt_qposadr()[joint] as usize, self.compiled.jnt_dofadr()[joint] as usize)
    }

    /// Name of the joint that a place in `qvel` belongs to, or its number if it has none.
    pub fn joint_of_velocity(&self, place: usize) -> String {
        let joint = self.compiled.dof_jntid()[place] as usize;
        let name = self.compiled.id_to_name(MjtObjBase::mjOBJ_JOINT, joint);
        name.map_or_else(|| format!("joint {joint}"), str::to_owned)
    }

    /// The body's first joint, if it is free: the body floats.
    pub fn free_joint(&self, body: usize) -> Option<usize> {
        let joint = usize::try_from(self.compiled.body_jntadr()[body]).ok()?;
        (self.compiled.jnt_type()[joint] == MjtJoint::mjJNT_FREE).then_some(joint)
    }

    /// The standing pose, `(nq)` [m, rad]: the reference configuration, `qpos0`, unless a keyframe was chosen.
    pub fn standing_position(&self) -> &[f64] {
        &self.standing
    }

    /// Makes the positions of the keyframe of this name the standing pose; false if there is none.
    pub fn stand_as_in(&mut self, keyframe: &str) -> bool {
        let found = self.compiled.name_to_id(MjtObjBase::mjOBJ_KEY, keyframe);
        let positions = found.map(|key| {
            let num_positions = self.standing.len();
            self.compiled.key_qpos()[key * num_positions..][..num_positions].to_vec()
        });
        positions.map(|positions| self.standing = positions).is_some()
    }

    /// Makes `(nq)` positions the standing pose.
    ///
    /// # Panics
    /// If there are not as many as the model has.
    pub fn stand_at(&mut self, positions: Vec<f64>) {
        assert_eq!(positions.len(), self.standing.len(), "a pose has a number for every coordinate");
        self.standing = positions;
    }

    /// The sphere of this body that can touch something, if there is one alone.
    pub fn only_sphere_of(&self, body: usize) -> Option<usize> {
        let touches = |geom: &usize| {
            self.compiled.geom_bodyid()[*geom] as usize == body
                && self.is_sphere(*geom)
                && (self.compiled.geom_contype()[*geom] != 0 || self.compiled.geom_conaffinity()[*geom] != 0)
        };
        let mut spheres = (0..self.compiled.ffi().ngeom as usize).filter(touches);
        spheres.next().filter(|_| spheres.next().is_none())
    }

    /// Radius of a sphere geom [m].
    pub fn geom_radius_m(&self, geom: usize) -> f64 {
        self.compiled.geom_size()[geom][0]
    }

    /// Whether the joint is a hinge.
    pub fn is_hinge(&self, joint: usize) -> bool {
        self.compiled.jnt_type()[joint] == MjtJoint::mjJNT_HINGE
    }

    /// Whether the geom is a sphere.
    pub fn is_sphere(&self, geom: usize) -> bool {
        self.compiled.geom_type()[geom] == MjtGeomBase::mjGEOM_SPHERE
    }

    /// Whether the geom is the plane z = 0 of the world.
    pub fn is_level_ground(&self, geom: usize) -> bool {
        let is_plane = self.compiled.geom_type()[geom] == MjtGeomBase::mjGEOM_PLANE;
        let [w, x, y, _] = self.compiled.geom_quat()[geom];
        let is_level = x.abs() < 1e-9 && y.abs() < 1e-9 && w.is_finite();
        is_plane && is_level && self.compiled.geom_bodyid()[geom] == 0 && self.compiled.geom_pos()[geom][2].abs() < 1e-9
    }

    /// Whether the geom belongs to a body that can move, and not to the world.
    pub fn is_on_robot(&self, geom: usize) -> bool {
        self.compiled.geom_bodyid()[geom] != 0
    }

    /// Sliding friction of a geom.
    pub fn friction(&self, geom: usize) -> f64 {
        self.compiled.geom_friction()[geom][0]
    }

    /// Sliding friction between two geoms: that of the one with the higher priority, the greater one of equals.
    pub fn contact_friction(&self, [first, second]: [usize; 2]) -> f64 {
        let priority = |geom: usize| self.compiled.geom_priority()[geom];
        match priority(first).cmp(&priority(second)) {
            std::cmp::Ordering::Greater => self.friction(first),
            std::cmp::Ordering::Less => self.friction(second),
            std::cmp::Ordering::Equal => self.friction(first).max(self.friction(second)),
        }
    }

    /// Radius of a sphere around the geom's centre that holds all of it [m].
    pub fn bounding_radius_m(&self, geom: usize) -> f64 {
        self.compiled.geom_rbound()[geom]
    }

    /// Makes MuJoCo obey [`Simulation::set_torque_range`] for a joint, whatever the model's file says.
    pub fn limit_torque(&mut self, joint: usize) {
        self.compiled.jnt_actfrclimited_mut()[joint] = true;
    }

    /// Sets the time step of [`Simulation::step`] [s].
    pub fn set_timestep_s(&mut self, timestep_s: f64) {
        self.compiled.opt_mut().timestep = timestep_s;
    }

    /// Sets gravity [m/s^2].
    pub fn set_gravity(&mut self, gravity: [f64; 3]) {
        self.compiled.opt_mut().gravity = gravity;
    }

    /// Sets the sliding friction of every geom and contact pair.
    pub fn set_friction(&mut self, friction: f64) {
        for geom in self.compiled.geom_friction_mut() {
            geom[0] = friction;
        }
        for pair in self.compiled.pair_friction_mut() {
            pair[0] = friction;
            pair[1] = friction;
        }
    }

    /// Multiplies every mass and, with it, every moment of inertia.
    pub fn scale_masses(&mut self, factor: f64) {
        self.compiled.body_mass_mut().iter_mut().for_each(|mass| *mass *= factor);
        self.compiled.body_inertia_mut().iter_mut().flatten().for_each(|moment| *moment *= factor);
        // What MuJoCo derived from the masses when it compiled the model has to follow.
        let mut data = MjData::new(Box::new(self.compiled.clone()));
        data.set_const();
        self.compiled = data.model().clone();
    }

    /// The model for changes that this interface does not name: what-if studies of single numbers.
    ///
    /// After a change of masses or sizes the caller owes MuJoCo a [`Simulation::update_constants`].
    pub fn raw_mut(&mut self) -> &mut MjModel {
        &mut self.compiled
    }

    /// The model, read-only, for what this interface does not name.
    pub fn raw(&self) -> &MjModel {
        &self.compiled
    }
}

/// A model with its state.
#[derive(Debug)]
pub struct Simulation {
    data: MjData<Box<MjModel>>,
    /// `(nq)` where it starts.
    standing: Vec<f64>,
}

impl Simulation {
    /// A simulation of its own copy of the model, in the standing pose.
    pub fn new(model: &Model) -> Self {
        let data = MjData::new(Box::new(model.compiled.clone()));
        let mut simulation = Self { data, standing: model.standing.clone() };
        simulation.reset();
        simulation
    }

    /// The model as it is in this simulation, read-only.
    pub fn model(&self) -> &MjModel {
        self.data.model()
    }

    /// Recomputes what MuJoCo derives from masses and sizes at compile time.
    pub fn update_constants(&mut self) {
        self.data.set_const();
    }

    /// Back to the standing pose at time 0, without warnings.
    pub fn reset(&mut self) {
        self.data.reset();
        self.data.qpos_mut().copy_from_slice(&self.standing);
    }

    /// One physics step.
    #[inline]
    pub fn step(&mut self) {
        self.data.step();
    }

    /// Computes all that follows from positions, velocities and controls, without moving on.
    pub fn forward(&mut self) {
        self.data.forward();
    }

    /// Computes where bodies and geoms are, and nothing else that the next step could depend on.
    pub fn update_positions(&mut self) {
        self.data.kinematics();
    }

    /// Finds the contacts where the geoms are now. Calls for [`update_positions`](Self::update_positions) before it.
    ///
    /// The next step finds them anew, so it does not depend on this.
    pub fn update_contacts(&mut self) {
        self.data.collision();
    }

    /// The generalised positions, `(nq)` [m, rad].
    pub fn qpos(&self) -> &[f64] {
        self.data.qpos()
    }

    /// The generalised positions, `(nq)` [m, rad].
    pub fn qpos_mut(&mut self) -> &mut [f64] {
        self.data.qpos_mut()
    }

    /// The generalised velocities, `(nv)` [m/s, rad/s].
    pub fn qvel(&self) -> &[f64] {
        self.data.qvel()
    }

    /// The generalised velocities, `(nv)` [m/s, rad/s].
    pub fn qvel_mut(&mut self) -> &mut [f64] {
        self.data.qvel_mut()
    }

    /// The actuator targets, `(nu)`.
    pub fn ctrl_mut(&mut self) -> &mut [f64] {
        self.data.ctrl_mut()
    }

    /// Forces of the actuators in joint space as of the last step, `(nv)` [N, N m].
    pub fn actuator_torques(&self) -> &[f64] {
        self.data.qfrc_actuator()
    }

    /// Limits the torque that the actuators may put on a joint from the next step on [N m].
    #[inline]
    pub fn set_torque_range(&mut self, joint: usize, range: [f64; 2]) {
        // SAFETY: only two numbers of the model change; no size, index or address does.
        unsafe { self.data.model_mut() }.jnt_actfrcrange_mut()[joint] = range;
    }

    /// Sets gravity from the next step on [m/s^2].
    pub fn set_gravity(&mut self, gravity: [f64; 3]) {
        // SAFETY: only three numbers of the model change; no size, index or address does.
        unsafe { self.data.model_mut() }.opt_mut().gravity = gravity;
    }

    /// Positions of the geoms' centres in the world as of the last step, `(ngeom x 3)` [m].
    pub fn geom_positions_in_world(&self) -> &[[f64; 3]] {
        self.data.geom_xpos()
    }

    /// Positions of the bodies in the world as of the last step, `(nbody x 3)` [m].
    pub fn body_positions_in_world(&self) -> &[[f64; 3]] {
        self.data.xpos()
    }

    /// Positions of the joints' anchors in the world as of the last step, `(njnt x 3)` [m].
    pub fn joint_positions_in_world(&self) -> &[[f64; 3]] {
        self.data.xanchor()
    }

    /// Directions of the joints' axes in the world as of the last step, `(njnt x 3)`.
    pub fn joint_axes_in_world(&self) -> &[[f64; 3]] {
        self.data.xaxis()
    }

    /// The two geoms of each contact that may carry a force, as of the last step.
    pub fn contacts(&self) -> impl Iterator<Item = [usize; 2]> {
        // MuJoCo also keeps contacts that are too far apart to carry a force; these are marked. A geom is -1 for soft
        // bodies only.
        let carrying = self.data.contact().iter().filter(|contact| contact.exclude == 0);
        carrying.filter_map(|contact| {
            Some([usize::try_from(contact.geom[0]).ok()?, usize::try_from(contact.geom[1]).ok()?])
        })
    }

    /// Simulated time [s].
    pub fn time_s(&self) -> f64 {
        self.data.time()
    }

    /// How far the model's loops are from closed: the largest error of an equality constraint [m, rad]; NaN if one is.
    pub fn loop_gap(&mut self) -> f64 {
        self.data.forward();
        let num_equalities = self.data.ne() as usize;
        let gaps = self.data.efc_pos().iter().take(num_equalities).map(|gap| gap.abs());
        // Not `max`: it passes over NaN.
        gaps.fold(0.0, |largest: f64, gap| if gap <= largest || largest.is_nan() { largest } else { gap })
    }

    /// Whether MuJoCo has met a number it could not go on with, or has dropped contacts, since the last reset.
    ///
    /// MuJoCo then resets the state silently, or leaves constraints out, and goes on.
    pub fn is_unstable(&self) -> bool {
        const UNSTABLE: [mjtWarning; 6] = [
            mjtWarning::mjWARN_CONTACTFULL,
            mjtWarning::mjWARN_CNSTRFULL,
            mjtWarning::mjWARN_BADQPOS,
            mjtWarning::mjWARN_BADQVEL,
            mjtWarning::mjWARN_BADQACC,
            mjtWarning::mjWARN_BADCTRL,
        ];
        UNSTABLE.iter().any(|&warning| self.data.warning()[warning as usize].number > 0)
    }

    /// Everything that the next step depends on, the solver's warm start included.
    pub fn state(&self) -> Vec<f64> {
        self.data.state(mjtState::mjSTATE_INTEGRATION as u32).into_vec()
    }

    /// Restores what [`state`](Self::state) gave for the same model.
    ///
    /// # Errors
    /// A state of another length is refused.
    pub fn set_state(&mut self, state: &[f64]) -> Result<(), String> {
        self.data.reset();
        self.data.set_state(state, mjtState::mjSTATE_INTEGRATION as u32).map_err(|error| error.to_string())
    }
}

/// Version of the MuJoCo library that is in use.
pub fn version() -> String {
    mujoco_rs::mujoco_version().to_owned()
}
