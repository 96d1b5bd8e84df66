//! MuJoCo's own renderer: poses of a model become pixels.

use std::ffi::CString;

use mujoco_rs::mujoco_c::{mjr_rectangle, mjr_text, mjtRndFlag};
use mujoco_rs::wrappers::mj_data::MjData;
use mujoco_rs::wrappers::mj_model::{MjModel, MjtGeom};
use mujoco_rs::wrappers::mj_rendering::{MjrContext, MjrRectangle, MjtFont, MjtFontScale};
use mujoco_rs::wrappers::mj_visualization::{MjvCamera, MjvGLCamera, MjvLight, MjvOption, MjvPerturb, MjvScene};

use super::Model;
use crate::render::gl::GlContext;

/// An upright rectangle of the picture, in pixels from the picture's lower left corner.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Area {
    /// Pixels to the left of it.
    pub left: u32,
    /// Pixels below it.
    pub bottom: u32,
    /// Pixels across.
    pub width: u32,
    /// Pixels from bottom to top.
    pub height: u32,
}

impl Area {
    fn to_mujoco(self) -> MjrRectangle {
        let pixels = |number: u32| i32::try_from(number).expect("a picture is smaller than 2^31 pixels");
        MjrRectangle::new(pixels(self.left), pixels(self.bottom), pixels(self.width), pixels(self.height))
    }
}

/// Where a picture is taken from, in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// The eye [m].
    pub position: [f64; 3],
    /// Unit vector of the sight.
    pub forward: [f64; 3],
    /// Unit vector that is up in the picture, at a right angle to `forward`.
    pub up: [f64; 3],
    /// Tangent of half the angle of view from bottom to top.
    pub half_height: f64,
}

/// A light that throws shadows, as far away as the sun, in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sun {
    /// In the middle above what throws a shadow [m].
    pub position: [f64; 3],
    /// Unit vector from the sun to the ground.
    pub direction: [f64; 3],
}

/// A box along the world's axes that belongs to no body: a mark on the ground, a wall.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mark {
    /// The centre [m].
    pub position: [f64; 3],
    /// Half the lengths of the edges [m].
    pub half_size: [f64; 3],
    /// Red, green and blue, from 0 to 1.
    pub rgb: [f32; 3],
}

/// How a model is to look, whatever its file says. Lights and colours go from 0 to 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Look {
    /// The ground's red, green and blue.
    pub ground_rgb: [f32; 3],
    /// What everything fades into far away.
    pub haze_rgb: [f32; 3],
    /// Light from everywhere.
    pub ambient: f32,
    /// Light from the camera.
    pub headlight: f32,
    /// Light of the [`Sun`].
    pub sunlight: f32,
    /// Side of the picture of the shadows in pixels.
    pub shadow_pixels: u32,
    /// Samples for each pixel, against jagged edges.
    pub num_samples: u32,
}

/// Size of letters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Letters {
    /// For a line of its own.
    Large,
    /// For the rest.
    Small,
}

/// A model in a pose, what is drawn of it, and what it is drawn with.
///
/// The state is the painter's own: drawing changes nothing of a simulation.
#[derive(Debug)]
pub struct Painter {
    data: MjData<Box<MjModel>>,
    scene: MjvScene,
    option: MjvOption,
    context: MjrContext,
    /// `context` lives on it and has to be dropped before it: fields are dropped in their order.
    gl: GlContext,
    picture: Area,
    sunlight: f32,
}

/// Boxes that a scene has room for beside the model's geoms.
pub const MAX_MARKS: usize = 256;

impl Painter {
    /// A painter of pictures of this width and height in pixels.
    ///
    /// `floor` is the number of the ground's geom. `reach_m` is the robot's size [m]: what lies many times as far away
    /// fades into haze.
    pub fn new(
        gl: GlContext,
        model: &Model,
        floor: usize,
        reach_m: f64,
        look: &Look,
        [width, height]: [u32; 2],
    ) -> Self {
        let picture = Area { left: 0, bottom: 0, width, height };
        let size = picture.to_mujoco();
        let mut model = Box::new(model.compiled.clone());
        model.stat_mut().extent = reach_m;
        let visual = model.vis_mut();
        (visual.global.offwidth, visual.global.offheight) = (size.width, size.height);
        visual.quality.offsamples = look.num_samples as i32;
        visual.quality.shadowsize = look.shadow_pixels as i32;
        // Multiples of the reach: how near and far the eye sees, where the haze begins and ends, and half the side of
        // the square with shadows.
        (visual.map.znear, visual.map.zfar) = (0.1, 200.0);
        (visual.map.fogstart, visual.map.fogend) = (8.0, 20.0);
        (visual.map.shadowclip, visual.map.shadowscale) = (3.0, 1.0);
        let [r, g, b] = look.haze_rgb;
        visual.rgba.fog = [r, g, b, 1.0];
        visual.rgba.haze = visual.rgba.fog;
        visual.headlight.active = 1;
        visual.headlight.ambient = [look.ambient; 3];
        visual.headlight.diffuse = [look.headlight; 3];
        visual.headlight.specular = [0.0; 3];
        let [r, g, b] = look.ground_rgb;
        model.geom_rgba_mut()[floor] = [r, g, b, 1.0];
        // SAFETY: -1 is no material, in every model.
        let materials = unsafe { model.geom_matid_mut() };
        materials[floor] = -1;
        let scene = MjvScene::new(&model, model.geom_rgba().len() + MAX_MARKS);
        let mut option = MjvOption::default();
        option.sitegroup.fill(0);
        // SAFETY: `gl` is current on this thread, and is dropped after the context.
        let mut context = unsafe { MjrContext::new(&model) };
        context.offscreen();
        // Large letters are then some 6 % of the picture's height.
        let scale = match height {
            ..300 => MjtFontScale::mjFONTSCALE_50,
            300..500 => MjtFontScale::mjFONTSCALE_100,
            500..650 => MjtFontScale::mjFONTSCALE_150,
            650..1000 => MjtFontScale::mjFONTSCALE_200,
            _ => MjtFontScale::mjFONTSCALE_300,
        };
        context.change_font(scale);
        Self { data: MjData::new(model), scene, option, context, gl, picture, sunlight: look.sunlight }
    }

    /// Puts the floor's middle at this point of the plane z = 0 [m].
    pub fn move_floor(&mut self, floor: usize, [x, y]: [f64; 2]) {
        // SAFETY: only where a geom is changes; no size, index or address does.
        unsafe { self.data.model_mut() }.geom_pos_mut()[floor] = [x, y, 0.0];
    }

    /// Puts the model into a pose.
    ///
    /// # Shapes
    /// - `qpos`: `(nq)`
    pub fn pose(&mut self, qpos: &[f64]) {
        self.data.qpos_mut().copy_from_slice(qpos);
        self.data.kinematics();
    }

    /// Begins a picture: all of it has this colour, from 0 to 1.
    pub fn begin(&mut self, [r, g, b]: [f32; 3]) {
        self.gl.make_current();
        // SAFETY: a rectangle of the picture that the context draws into.
        unsafe { mjr_rectangle(self.picture.to_mujoco(), r, g, b, 1.0) };
    }

    /// Draws the model and the marks into an area of the picture.
    ///
    /// # Panics
    /// More than [`MAX_MARKS`].
    pub fn draw(&mut self, area: Area, camera: &Camera, sun: &Sun, marks: &[Mark]) {
        self.look_through(camera);
        self.scene.update(&mut self.data, &self.option, &MjvPerturb::default(), &mut MjvCamera::new_user());
        for &Mark { position, half_size, rgb: [r, g, b] } in marks {
            let (kind, rgba) = (MjtGeom::mjGEOM_BOX, [r, g, b, 1.0]);
            // SAFETY: a box has no number of a flex or a skin, and MuJoCo gives it neither material nor texture.
            unsafe { self.scene.create_geom(kind, Some(half_size), Some(position), None, Some(rgba)) };
        }
        self.light(sun);
        self.scene.render(&area.to_mujoco(), &self.context);
    }

    fn look_through(&mut self, camera: &Camera) {
        let (map, extent) = (&self.data.model().vis().map, self.data.model().stat().extent as f32);
        let near = map.znear * extent;
        let half_height = near * camera.half_height as f32;
        let eye = MjvGLCamera {
            pos: camera.position.map(|value| value as f32),
            forward: camera.forward.map(|value| value as f32),
            up: camera.up.map(|value| value as f32),
            frustum_center: 0.0,
            // MuJoCo takes the width from the shape of the area.
            frustum_width: 0.0,
            frustum_bottom: -half_height,
            frustum_top: half_height,
            frustum_near: near,
            frustum_far: map.zfar * extent,
            orthographic: 0,
        };
        // SAFETY: only numbers of the two eyes change, which are one here.
        unsafe { self.scene.ffi_mut() }.camera = [eye.clone(), eye];
    }

    /// Of all lights, leaves the camera's and adds the sun.
    fn light(&mut self, sun: &Sun) {
        // SAFETY: `nlight` still counts lights that are filled in, of a fixed array with room for many more than two.
        let scene = unsafe { self.scene.ffi_mut() };
        let lit = &scene.lights[..scene.nlight as usize];
        // The painter has switched it on for its model.
        let headlight = lit.iter().find(|light| light.headlight != 0).expect("a headlight").clone();
        let sun = MjvLight {
            pos: sun.position.map(|value| value as f32),
            dir: sun.direction.map(|value| value as f32),
            headlight: 0,
            castshadow: 1,
            ambient: [0.0; 3],
            diffuse: [self.sunlight; 3],
            specular: [0.3; 3],
            ..headlight.clone()
        };
        scene.lights[0] = headlight;
        scene.lights[1] = sun;
        scene.nlight = 2;
        for (flag, is_on) in [
            (mjtRndFlag::mjRND_SHADOW, true),
            (mjtRndFlag::mjRND_FOG, true),
            (mjtRndFlag::mjRND_HAZE, false),
            (mjtRndFlag::mjRND_SKYBOX, false),
            (mjtRndFlag::mjRND_REFLECTION, false),
        ] {
            scene.flags[flag as usize] = u8::from(is_on);
        }
    }

    /// Writes a line of text into the area that was drawn last, at a place that counts from its lower left corner: 1 is
    /// its width or height.
    ///
    /// MuJoCo has no letters but ASCII; others become question marks.
    pub fn write(&mut self, text: &str, letters: Letters, [x, y]: [f32; 2], [r, g, b]: [f32; 3]) {
        let is_printable = |letter: &char| (' '..='~').contains(letter);
        let ascii: String = text.chars().map(|letter| if is_printable(&letter) { letter } else { '?' }).collect();
        let ascii = CString::new(ascii).expect("printable letters hold no zero");
        let font = match letters {
            Letters::Large => MjtFont::mjFONT_BIG,
            Letters::Small => MjtFont::mjFONT_NORMAL,
        };
        // SAFETY: the text ends with a zero and has no letters but those of MuJoCo's fonts.
        unsafe { mjr_text(font as i32, ascii.as_ptr(), self.context.ffi(), x, y, r, g, b) };
    }

    /// Reads the picture, row by row from the top, three bytes a pixel: red, green, blue.
    pub fn read(&mut self, rgb: &mut Vec<u8>) {
        let row = 3 * self.picture.width as usize;
        rgb.resize(row * self.picture.height as usize, 0);
        let read = self.context.read_pixels(Some(rgb), None, &self.picture.to_mujoco());
        read.expect("the buffer was made as large as the picture");
        // OpenGL begins at the bottom.
        let (upper, lower) = rgb.split_at_mut(row * (self.picture.height as usize / 2));
        for (above, below) in upper.chunks_exact_mut(row).zip(lower.chunks_exact_mut(row).rev()) {
            above.swap_with_slice(below);
        }
    }
}

impl Drop for Painter {
    fn drop(&mut self) {
        // What is to be freed lies in this context, and another one may be current.
        self.gl.make_current();
    }
}
