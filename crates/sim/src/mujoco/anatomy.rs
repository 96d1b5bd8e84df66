//! What a model is made of, as plain data: for looking at models that nobody has described yet.

use mujoco_rs::wrappers::mj_model::{MjtBias, MjtEq, MjtGeomBase, MjtJoint, MjtObjBase, MjtTrn};

use super::{Model, Simulation};

/// A body.
#[derive(Clone, Debug, PartialEq)]
pub struct BodyPart {
    /// Its name; empty if it has none.
    pub name: String,
    /// The body that it hangs from; the world hangs from itself.
    pub parent: usize,
    /// Its mass [kg].
    pub mass_kg: f64,
    /// Its principal moments of inertia [kg m^2].
    pub inertia: [f64; 3],
}

/// How a joint moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JointKind {
    /// It turns about an axis.
    Hinge,
    /// All six ways: the body floats.
    Free,
    /// Anything else.
    Other,
}

/// A joint in the standing pose.
#[derive(Clone, Debug, PartialEq)]
pub struct JointPart {
    /// Its name; empty if it has none.
    pub name: String,
    /// The body that it moves.
    pub body: usize,
    /// How it moves.
    pub kind: JointKind,
    /// Direction of its axis.
    pub axis_in_world: [f64; 3],
    /// A point of its axis [m].
    pub anchor_in_world: [f64; 3],
    /// Least and greatest angle [rad], if it has stops.
    pub range: Option<[f64; 2]>,
    /// Greatest torque that the actuators may put on it [N m], if the joint limits it.
    pub max_torque_nm: Option<f64>,
}

/// A geom in the standing pose.
#[derive(Clone, Debug, PartialEq)]
pub struct GeomPart {
    /// Its name; empty if it has none.
    pub name: String,
    /// The body that it belongs to.
    pub body: usize,
    /// Whether it is a sphere.
    pub is_sphere: bool,
    /// Whether it is the plane z = 0 of the world.
    pub is_level_ground: bool,
    /// Whether anything can touch it.
    pub collides: bool,
    /// Where its centre is [m].
    pub position_in_world: [f64; 3],
    /// Radius of a sphere around it [m].
    pub bounding_radius_m: f64,
    /// Half its sizes, as MuJoCo has them [m].
    pub size: [f64; 3],
}

/// What an actuator pulls on.
#[derive(Clone, Debug, PartialEq)]
pub enum Pull {
    /// One joint, over a gear.
    Joint(usize, f64),
    /// Several joints by a fixed tendon, each with its coefficient.
    Tendon(Vec<(usize, f64)>),
    /// Anything else.
    Other,
}

/// An actuator.
#[derive(Clone, Debug, PartialEq)]
pub struct ActuatorPart {
    /// Its name; empty if it has none.
    pub name: String,
    /// What it pulls on.
    pub pull: Pull,
    /// Gain of its position control [N m/rad]; none if it is a motor that is given torques.
    pub position_gain: Option<f64>,
    /// Gain on the velocity [N m s/rad].
    pub velocity_gain: f64,
    /// Greatest force behind the gear [N m], if it is limited.
    pub max_force: Option<f64>,
}

/// What a model is made of, in its standing pose. Places in the lists are MuJoCo's numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct Anatomy {
    /// The bodies, the world first.
    pub bodies: Vec<BodyPart>,
    /// The joints.
    pub joints: Vec<JointPart>,
    /// The geoms.
    pub geoms: Vec<GeomPart>,
    /// The actuators.
    pub actuators: Vec<ActuatorPart>,
    /// Bodies that a point holds together: what closes a loop.
    pub connected: Vec<[usize; 2]>,
    /// Names of the keyframes.
    pub keyframes: Vec<String>,
}

impl Anatomy {
    /// The body, what it hangs from, and so on, without the world.
    pub fn ancestors(&self, body: usize) -> impl Iterator<Item = usize> {
        let parent = |&body: &usize| Some(self.bodies[body].parent);
        std::iter::successors(Some(body), parent).take_while(|&body| body != 0)
    }

    /// The actuators that pull on a joint.
    pub fn actuators_of(&self, joint: usize) -> impl Iterator<Item = (usize, &ActuatorPart)> {
        self.actuators.iter().enumerate().filter(move |(_, actuator)| match &actuator.pull {
            Pull::Joint(own, _) => *own == joint,
            Pull::Tendon(joints) => joints.iter().any(|(own, _)| *own == joint),
            Pull::Other => false,
        })
    }

    /// The body that floats: of several the one with most bodies on it.
    pub fn floating_body(&self) -> Option<usize> {
        let floating = self.joints.iter().filter(|joint| joint.kind == JointKind::Free).map(|joint| joint.body);
        let size = |root: usize| (0..self.bodies.len()).filter(|&body| self.ancestors(body).any(|b| b == root)).count();
        floating.max_by_key(|&body| size(body))
    }
}

impl Model {
    /// What the model is made of, in its standing pose.
    pub fn anatomy(&self) -> Anatomy {
        let model = &self.compiled;
        let mut standing = Simulation::new(self);
        standing.update_positions();
        let name = |kind, id| model.id_to_name(kind, id).unwrap_or_default().to_owned();
        let sizes = model.ffi();
        let limited = |is: bool, [low, high]: [f64; 2]| is.then(|| low.abs().min(high.abs()));
        let joint = |id: usize| JointPart {
            name: name(MjtObjBase::mjOBJ_JOINT, id),
            body: model.jnt_bodyid()[id] as usize,
            kind: match model.jnt_type()[id] {
                MjtJoint::mjJNT_HINGE => JointKind::Hinge,
                MjtJoint::mjJNT_FREE => JointKind::Free,
                _ => JointKind::Other,
            },
            axis_in_world: standing.joint_axes_in_world()[id],
            anchor_in_world: standing.joint_positions_in_world()[id],
            range: model.jnt_limited()[id].then(|| model.jnt_range()[id]),
            max_torque_nm: limited(model.jnt_actfrclimited()[id], model.jnt_actfrcrange()[id]),
        };
        let geom = |id: usize| GeomPart {
            name: name(MjtObjBase::mjOBJ_GEOM, id),
            body: model.geom_bodyid()[id] as usize,
            is_sphere: model.geom_type()[id] == MjtGeomBase::mjGEOM_SPHERE,
            is_level_ground: self.is_level_ground(id),
            collides: model.geom_contype()[id] != 0 || model.geom_conaffinity()[id] != 0,
            position_in_world: standing.geom_positions_in_world()[id],
            bounding_radius_m: self.bounding_radius_m(id),
            size: model.geom_size()[id],
        };
        let connected = (0..sizes.neq as usize).filter(|&id| model.eq_type()[id] == MjtEq::mjEQ_CONNECT);
        Anatomy {
            bodies: (0..sizes.nbody as usize)
                .map(|id| BodyPart {
                    name: name(MjtObjBase::mjOBJ_BODY, id),
                    parent: model.body_parentid()[id] as usize,
                    mass_kg: model.body_mass()[id],
                    inertia: model.body_inertia()[id],
                })
                .collect(),
            joints: (0..sizes.njnt as usize).map(joint).collect(),
            geoms: (0..sizes.ngeom as usize).map(geom).collect(),
            actuators: (0..sizes.nu as usize).map(|id| self.actuator(id)).collect(),
            connected: connected.map(|id| self.connected_bodies(id)).collect(),
            keyframes: (0..sizes.nkey as usize).map(|id| name(MjtObjBase::mjOBJ_KEY, id)).collect(),
        }
    }

    fn actuator(&self, id: usize) -> ActuatorPart {
        let model = &self.compiled;
        let target = model.actuator_trnid()[id][0] as usize;
        let gear = model.actuator_gear()[id][0];
        let pull = match model.actuator_trntype()[id] {
            MjtTrn::mjTRN_JOINT | MjtTrn::mjTRN_JOINTINPARENT => Pull::Joint(target, gear),
            MjtTrn::mjTRN_TENDON => {
                let (first, number) = (model.tendon_adr()[target] as usize, model.tendon_num()[target] as usize);
                let joint = |place: usize| (model.wrap_objid()[place] as usize, gear * model.wrap_prm()[place]);
                // The wraps of a fixed tendon are joints; those of others are geoms and sites, of which nothing is known.
                let is_fixed = (first..first + number)
                    .all(|place| model.wrap_type()[place] == mujoco_rs::wrappers::mj_model::MjtWrap::mjWRAP_JOINT);
                if is_fixed { Pull::Tendon((first..first + number).map(joint).collect()) } else { Pull::Other }
            }
            _ => Pull::Other,
        };
        let bias = model.actuator_biasprm()[id];
        let is_servo = model.actuator_biastype()[id] == MjtBias::mjBIAS_AFFINE && bias[1] != 0.0;
        let range =
            |is_limited: bool, [low, high]: [f64; 2]| is_limited.then(|| low.abs().min(high.abs()) * gear.abs());
        let force = range(model.actuator_forcelimited()[id], model.actuator_forcerange()[id]);
        // A motor's command is its force.
        let command = range(model.actuator_ctrllimited()[id] && !is_servo, model.actuator_ctrlrange()[id])
            .map(|command| command * model.actuator_gainprm()[id][0].abs());
        ActuatorPart {
            name: model.id_to_name(MjtObjBase::mjOBJ_ACTUATOR, id).unwrap_or_default().to_owned(),
            pull,
            position_gain: is_servo.then(|| -bias[1] * gear * gear),
            velocity_gain: -bias[2] * gear * gear,
            max_force: [force, command].into_iter().flatten().reduce(f64::min),
        }
    }

    fn connected_bodies(&self, equality: usize) -> [usize; 2] {
        let model = &self.compiled;
        let is_site = model.eq_objtype()[equality] == MjtObjBase::mjOBJ_SITE;
        [model.eq_obj1id()[equality], model.eq_obj2id()[equality]]
            .map(|id| if is_site { model.site_bodyid()[id as usize] as usize } else { id as usize })
    }

    /// Makes a position servo of an actuator that pulls on a joint, whatever the model's file has made it: at a gear `g`,
    ///
    /// ```text
    /// torque = kp (target - angle) - kv velocity
    /// ```
    ///
    /// Source: MuJoCo's documentation of position actuators.
    ///
    /// Its command is an angle then [rad] and has no limits; the limit of its force stays, and what limited a motor's command
    /// limits its force.
    ///
    /// # Errors
    /// What is in the way: an actuator that pulls on something else, or that has a state of its own.
    pub fn make_servo(&mut self, actuator: usize, [kp, kv]: [f64; 2]) -> Result<(), &'static str> {
        let model = &mut self.compiled;
        if !matches!(model.actuator_trntype()[actuator], MjtTrn::mjTRN_JOINT | MjtTrn::mjTRN_JOINTINPARENT) {
            return Err("it does not pull on a joint");
        }
        if model.actuator_actnum()[actuator] != 0 {
            return Err("it has dynamics of its own");
        }
        let gear = model.actuator_gear()[actuator][0];
        if gear == 0.0 {
            return Err("its gear is 0");
        }
        let was_motor = model.actuator_biastype()[actuator] == MjtBias::mjBIAS_NONE;
        if was_motor && model.actuator_ctrllimited()[actuator] {
            let (gain, range) = (model.actuator_gainprm()[actuator][0], model.actuator_ctrlrange()[actuator]);
            let own = model.actuator_forcelimited()[actuator].then(|| model.actuator_forcerange()[actuator]);
            let [low, high] = own.unwrap_or([f64::NEG_INFINITY, f64::INFINITY]);
            model.actuator_forcerange_mut()[actuator] = [low.max(gain * range[0]), high.min(gain * range[1])];
            model.actuator_forcelimited_mut()[actuator] = true;
        }
        // MuJoCo multiplies a force by the gear, and takes the gear times the angle for the length.
        // SAFETY: no size, index or address changes; these are numbers and kinds of one actuator.
        unsafe {
            model.actuator_gaintype_mut()[actuator] = mujoco_rs::wrappers::mj_model::MjtGain::mjGAIN_FIXED;
            model.actuator_biastype_mut()[actuator] = MjtBias::mjBIAS_AFFINE;
            model.actuator_gainprm_mut()[actuator][0] = kp / gear;
        }
        let bias = &mut model.actuator_biasprm_mut()[actuator];
        bias[0] = 0.0;
        bias[1] = -kp / (gear * gear);
        bias[2] = -kv / (gear * gear);
        model.actuator_ctrllimited_mut()[actuator] = false;
        Ok(())
    }
}
