//! Uneven ground: the floor of a model becomes a height field that can be written and moved.

use mujoco_rs::mujoco_c::mjtSameFrame;
use mujoco_rs::wrappers::mj_editing::{MjSpec, SpecItem};
use mujoco_rs::wrappers::mj_model::MjtGeomBase;

use super::{Model, Simulation, Source};
use crate::ground::FieldShape;

/// Name of the height field in the model.
const FIELD: &str = "canter uneven ground";

/// Half the size of the box that bounds the world wherever its floor is moved [m].
const EVERYWHERE_M: f64 = 1e9;

impl Model {
    /// The same model with a height field of this shape as its floor, which is flat until it is
    /// [written](Simulation::height_field_mut). Every number of a body, joint, geom or actuator stays what it is.
    ///
    /// # Errors
    /// MuJoCo's own words.
    pub fn on_uneven_ground(&self, floor: usize, name: &str, field: &FieldShape) -> Result<Self, String> {
        let spec = match &self.source {
            Source::File(path) => MjSpec::from_xml(path),
            Source::Text(text) => MjSpec::from_xml_string(text),
        };
        let mut spec = spec.map_err(|error| error.to_string())?;
        let num_points = i32::try_from(field.num_points).map_err(|error| error.to_string())?;
        let height_field = spec.add_hfield();
        height_field
            .with_name(FIELD)
            .with_size([field.half_side_m, field.half_side_m, field.top_m, field.base_m])
            .with_nrow(num_points)
            .with_ncol(num_points)
            .set_userdata(vec![0.0; field.num_points * field.num_points]);
        let geom = spec.geom_mut(name).ok_or_else(|| format!("there is no geom called `{name}`"))?;
        geom.with_type(MjtGeomBase::mjGEOM_HFIELD)
            .with_hfieldname(FIELD)
            .with_pos([0.0; 3])
            .with_quat([1.0, 0.0, 0.0, 0.0]);
        let mut compiled = spec.compile().map_err(|error| error.to_string())?;
        if compiled.geom_type()[floor] != MjtGeomBase::mjGEOM_HFIELD {
            return Err(format!("the geom `{name}` has changed its number"));
        }
        // What was changed since the model was loaded.
        compiled.jnt_actfrclimited_mut().copy_from_slice(self.compiled.jnt_actfrclimited());
        // MuJoCo takes a shortcut for geoms in the middle of their body, and finds a body's geoms by bounds that it computes
        // once: the floor will not stay where it is.
        compiled.geom_sameframe_mut()[floor] = mjtSameFrame::mjSAMEFRAME_NONE;
        let world_bounds = compiled.body_bvhadr()[0].max(0) as usize..;
        let num_bounds = compiled.body_bvhnum()[0] as usize;
        for bounds in compiled.bvh_aabb_mut()[world_bounds].iter_mut().take(num_bounds) {
            *bounds = [0.0, 0.0, 0.0, EVERYWHERE_M, EVERYWHERE_M, EVERYWHERE_M];
        }
        Ok(Self { standing: self.standing.clone(), compiled, source: self.source.clone() })
    }
}

impl Simulation {
    /// Heights of the floor of a model [on uneven ground](Model::on_uneven_ground), row by row from right to left, each from
    /// the back to the front; shares of the field's greatest height.
    pub fn height_field_mut(&mut self) -> &mut [f32] {
        let model = self.model_mut();
        let id = (0..model.hfield_nrow().len()).next_back();
        // It was added last.
        let first = id.map_or(0, |id| model.hfield_adr()[id] as usize);
        &mut model.hfield_data_mut()[first..]
    }

    /// Makes the floor of a model [on uneven ground](Model::on_uneven_ground), `own`, a plane for as long as it is even: half
    /// the time of a physics step on a height field goes into its contacts.
    pub fn set_floor_even(&mut self, own: &Model, floor: usize, is_even: bool) {
        let model = self.model_mut();
        // SAFETY: the collisions of a plane read nothing of its geom but its place; the height field stays where it is.
        let kinds = unsafe { model.geom_type_mut() };
        kinds[floor] = if is_even { MjtGeomBase::mjGEOM_PLANE } else { MjtGeomBase::mjGEOM_HFIELD };
        // What has no end has no radius.
        model.geom_rbound_mut()[floor] = if is_even { 0.0 } else { own.compiled.geom_rbound()[floor] };
        model.geom_pos_mut()[floor] = [0.0; 3];
    }

    /// The model as it is now: its ground, and what else episodes change.
    pub(crate) fn to_model(&self) -> Model {
        let compiled = self.data.model().clone();
        Model { compiled, standing: self.standing.clone(), source: Source::Text("".into()) }
    }

    /// Puts the floor's middle at this point of the plane z = 0 [m].
    pub fn move_floor(&mut self, floor: usize, [x, y]: [f64; 2]) {
        self.model_mut().geom_pos_mut()[floor] = [x, y, 0.0];
    }
}
