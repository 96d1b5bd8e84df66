//! What changes of a simulation's model from one episode to the next. Everything is said against the robot's own model,
//! so that changes do not add up.

use std::cmp::Ordering;

use mujoco_rs::mujoco_c::mjtSameFrame;
use mujoco_rs::wrappers::mj_model::MjModel;

use super::{Model, Simulation};
use crate::frame;

impl Simulation {
    /// Sets the sliding friction of every geom and contact pair; none: the model's own.
    pub fn set_friction(&mut self, own: &Model, friction: Option<f64>) {
        let model = self.model_mut();
        for (geom, own) in model.geom_friction_mut().iter_mut().zip(own.compiled.geom_friction()) {
            geom[0] = friction.unwrap_or(own[0]);
        }
        for (pair, own) in model.pair_friction_mut().iter_mut().zip(own.compiled.pair_friction()) {
            pair[0] = friction.unwrap_or(own[0]);
            pair[1] = friction.unwrap_or(own[1]);
        }
    }

    /// Sets the sliding friction of one geom, and of every contact pair that it is in.
    pub fn set_friction_of(&mut self, geom: usize, friction: f64) {
        let model = self.model_mut();
        model.geom_friction_mut()[geom][0] = friction;
        for pair in 0..model.pair_friction().len() {
            let geoms = [model.pair_geom1()[pair], model.pair_geom2()[pair]];
            if geoms.contains(&(geom as i32)) {
                model.pair_friction_mut()[pair][..2].fill(friction);
            }
        }
    }

    /// Makes the friction of `foot` that of its contact with `floor`, which stays what it is in everything else.
    ///
    /// A foot with priority decides already. From a floor with priority the foot takes over the contact as it is. Of equals
    /// the greater friction counts: the floor's becomes 0.
    pub fn leave_friction_to(&mut self, own: &Model, foot: usize, floor: usize) {
        let priority = |geom: usize| own.compiled.geom_priority()[geom];
        let model = self.model_mut();
        match priority(foot).cmp(&priority(floor)) {
            Ordering::Greater => {}
            Ordering::Equal => model.geom_friction_mut()[floor][0] = 0.0,
            Ordering::Less => {
                model.geom_priority_mut()[foot] = priority(floor) + 1;
                model.geom_friction_mut()[foot] = own.compiled.geom_friction()[floor];
                model.geom_solref_mut()[foot] = own.compiled.geom_solref()[floor];
                model.geom_solimp_mut()[foot] = own.compiled.geom_solimp()[floor];
                // SAFETY: the number is one that MuJoCo compiled, and contacts are counted anew at each step.
                unsafe { model.geom_condim_mut()[foot] = own.compiled.geom_condim()[floor] };
            }
        }
    }

    /// Multiplies the force of every actuator, as a function of its target, its length and its velocity.
    pub fn set_gains(&mut self, own: &Model, factor: f64) {
        let model = self.model_mut();
        // SAFETY: only what the forces are multiplied by changes; no size, index or address does.
        let gains = unsafe { model.actuator_gainprm_mut() };
        for (gain, own) in gains.iter_mut().zip(own.compiled.actuator_gainprm()) {
            gain[0] = own[0] * factor;
        }
        for (bias, own) in model.actuator_biasprm_mut().iter_mut().zip(own.compiled.actuator_biasprm()) {
            for (bias, own) in bias.iter_mut().zip(own).take(3) {
                *bias = own * factor;
            }
        }
    }

    /// Multiplies every mass and moment of inertia, and shifts the centre of mass of body `trunk` along its axes [m].
    ///
    /// The state is lost.
    pub fn set_masses(&mut self, own: &Model, factor: f64, trunk: usize, shift_m: [f64; 3]) {
        let own = &own.compiled;
        let model = self.model_mut();
        for (mass, own) in model.body_mass_mut().iter_mut().zip(own.body_mass()) {
            *mass = own * factor;
        }
        let moments = model.body_inertia_mut().iter_mut().flatten();
        for (moment, own) in moments.zip(own.body_inertia().iter().flatten()) {
            *moment = own * factor;
        }
        shift_centre_of_mass(model, own, trunk, shift_m);
        // What MuJoCo derived from the masses when it compiled the model has to follow.
        self.update_constants();
    }

    pub(super) fn model_mut(&mut self) -> &mut MjModel {
        // SAFETY: callers in this module change numbers of the physics only; no size, index or address.
        unsafe { self.data.model_mut() }
    }
}

/// Shifts the centre of mass of a body, and keeps where MuJoCo finds its geoms and their bounds.
fn shift_centre_of_mass(model: &mut MjModel, own: &MjModel, body: usize, shift_m: [f64; 3]) {
    let is_shifted = shift_m != [0.0; 3];
    for (axis, shift) in shift_m.into_iter().enumerate() {
        model.body_ipos_mut()[body][axis] = own.body_ipos()[body][axis] + shift;
    }
    // Frames that were the same as that of the inertia, for which MuJoCo takes a shortcut, are no longer.
    let frame_of = |own: mjtSameFrame| {
        let is_at_inertia = own == mjtSameFrame::mjSAMEFRAME_INERTIA;
        if is_shifted && is_at_inertia { mjtSameFrame::mjSAMEFRAME_NONE } else { own }
    };
    let own_frame = own.body_sameframe()[body];
    model.body_sameframe_mut()[body] = if is_shifted { mjtSameFrame::mjSAMEFRAME_NONE } else { own_frame };
    let geoms = own.geom_bodyid().iter().map(|&id| id as usize).enumerate();
    for (geom, _) in geoms.filter(|(_, owner)| *owner == body) {
        model.geom_sameframe_mut()[geom] = frame_of(own.geom_sameframe()[geom]);
    }
    let sites = own.site_bodyid().iter().map(|&id| id as usize).enumerate();
    for (site, _) in sites.filter(|(_, owner)| *owner == body) {
        model.site_sameframe_mut()[site] = frame_of(own.site_sameframe()[site]);
    }
    // Bounds are kept in the inertia's frame: they move the other way.
    let body_from_inertia = frame::from_quaternion(own.body_iquat()[body]);
    let moved: [f64; 3] = std::array::from_fn(|axis| (0..3).map(|i| body_from_inertia[i][axis] * shift_m[i]).sum());
    let first = own.body_bvhadr()[body].max(0) as usize;
    for node in first..first + own.body_bvhnum()[body] as usize {
        for (axis, moved) in moved.into_iter().enumerate() {
            model.bvh_aabb_mut()[node][axis] = own.bvh_aabb()[node][axis] - moved;
        }
    }
}
