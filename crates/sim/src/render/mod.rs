//! Pictures of robots side by side, drawn by MuJoCo's own renderer without a window.

mod camera;
pub(crate) mod gl;

use std::sync::Arc;

use crate::env::Env;
use crate::mujoco::painter::{Area, Letters, Look, MAX_MARKS, Mark, Painter};
use crate::mujoco::{Model, Simulation};
use crate::robot::Robot;

use self::gl::GlContext;

/// Why there are no pictures.
#[derive(Debug, thiserror::Error)]
pub enum RenderError {
    /// No OpenGL without a window.
    #[error(
        "there is no OpenGL that draws without a window ({}); on Debian or Ubuntu, install it with \
         `apt install libegl1 libgl1-mesa-dri`, or with `apt install libosmesa6`", .0.join("; ")
    )]
    NoOpenGl(Vec<String>),
}

/// What has to be known to draw a robot: its generalised positions, `qpos`.
#[derive(Clone, Debug, PartialEq)]
pub struct Pose {
    qpos: Vec<f64>,
    /// Where the middle of uneven ground lies: forward, left [m].
    ground: [f64; 2],
}

impl Pose {
    /// `(nq)` [m, rad].
    pub(crate) fn qpos(&self) -> &[f64] {
        &self.qpos
    }
}

/// Uneven ground of an episode, to be drawn.
#[derive(Clone, Debug)]
pub struct Terrain(Arc<Model>);

impl PartialEq for Terrain {
    fn eq(&self, other: &Self) -> bool {
        self.0.raw().hfield_data() == other.0.raw().hfield_data()
    }
}

impl Env {
    /// The robot's pose, after a reset or a step.
    pub fn pose(&self) -> Pose {
        Pose { qpos: self.simulation().qpos().to_vec(), ground: self.ground_middle() }
    }

    /// The ground of this episode, to be [drawn](Renderer::on_terrain); none if it is even.
    pub fn terrain(&self) -> Option<Terrain> {
        self.is_on_uneven_ground().then(|| Terrain(Arc::new(self.simulation().to_model())))
    }
}

/// A robot, how it is seen, and what is written beside it.
#[derive(Clone, Debug)]
pub struct Panel<'a> {
    /// How it stands.
    pub pose: &'a Pose,
    /// The point of the ground that the camera follows: forward, left [m].
    pub target: [f64; 2],
    /// The line at the top.
    pub title: &'a str,
    /// The line below it.
    pub subtitle: &'a str,
    /// The line at the bottom.
    pub footer: &'a str,
}

/// Bright ground in haze, so that robots of any colour stand out; four samples are the most that Mesa's software takes.
const LOOK: Look = Look {
    ground_rgb: [0.80, 0.82, 0.84],
    haze_rgb: [0.93, 0.95, 0.97],
    ambient: 0.45,
    headlight: 0.35,
    sunlight: 0.45,
    shadow_pixels: 1536,
    num_samples: 4,
};

const LINE_RGB: [f32; 3] = [0.66, 0.70, 0.75];
const METRE_LINE_RGB: [f32; 3] = [0.50, 0.56, 0.64];
const TEXT_RGB: [f32; 3] = [0.13, 0.15, 0.18];
const GAP_RGB: [f32; 3] = [1.0; 3];
/// Pixels between two panels.
const GAP_PIXELS: u32 = 2;

/// Lines on the ground lie this far apart [m]; every fourth counts a metre.
const LINE_SPACING_M: f64 = 0.25;
const LINES_PER_METRE: i64 = 4;
/// Half the width of a line, and of one that counts a metre [m].
const LINE_M: f64 = 0.002;
const METRE_LINE_M: f64 = 0.005;
/// How far the lines reach from the target, as a multiple of the robot's size: into the haze.
const LINES_REACH: f64 = 20.0;
/// At most so many lines along each axis, however large the robot.
const MAX_LINES: usize = MAX_MARKS / 2 - 2;

/// Draws panels side by side into a picture of a fixed size.
///
/// It belongs to the thread that made it.
#[derive(Debug)]
pub struct Renderer {
    painter: Painter,
    size: [u32; 2],
    /// The robot's size: the greatest distance of anything on it from the body's centre [m].
    reach_m: f64,
    slope_rad: f64,
    /// The ground's geom if it is uneven, and so has no lines.
    uneven_floor: Option<usize>,
    rgb: Vec<u8>,
}

impl Renderer {
    /// A renderer for pictures of this width and height in pixels, on ground that rises forward by `slope_rad` [rad].
    ///
    /// # Errors
    /// There is no OpenGL that draws without a window; says what to install.
    pub fn new(robot: &Robot, size: [u32; 2], slope_rad: f64) -> Result<Self, RenderError> {
        let reach_m = reach_m(robot);
        let painter = Painter::new(GlContext::new()?, &robot.model, robot.floor, reach_m, &LOOK, size);
        Ok(Self { painter, size, reach_m, slope_rad, uneven_floor: None, rgb: Vec::new() })
    }

    /// The same on an episode's uneven ground.
    ///
    /// # Errors
    /// There is no OpenGL that draws without a window; says what to install.
    pub fn on_terrain(robot: &Robot, terrain: &Terrain, size: [u32; 2], slope_rad: f64) -> Result<Self, RenderError> {
        let reach_m = reach_m(robot);
        let painter = Painter::new(GlContext::new()?, &terrain.0, robot.floor, reach_m, &LOOK, size);
        Ok(Self { painter, size, reach_m, slope_rad, uneven_floor: Some(robot.floor), rgb: Vec::new() })
    }

    /// Draws the panels from left to right. Row by row from the top, three bytes a pixel: red, green, blue.
    pub fn draw(&mut self, panels: &[Panel<'_>]) -> &[u8] {
        self.painter.begin(GAP_RGB);
        let [width, height] = self.size;
        let count = panels.len().max(1) as u32;
        let panel_width = (width - GAP_PIXELS * (count - 1)) / count;
        for (i, panel) in (0..).zip(panels) {
            let area = Area { left: i * (panel_width + GAP_PIXELS), bottom: 0, width: panel_width, height };
            self.draw_panel(area, panel);
        }
        self.painter.read(&mut self.rgb);
        &self.rgb
    }

    fn draw_panel(&mut self, area: Area, panel: &Panel<'_>) {
        let camera = camera::beside(panel.target, self.reach_m, self.slope_rad);
        let sun = camera::sun_above(panel.target, self.reach_m);
        if let Some(floor) = self.uneven_floor {
            self.painter.move_floor(floor, panel.pose.ground);
        }
        self.painter.pose(panel.pose.qpos());
        self.painter.draw(area, &camera, &sun, &self.marks(panel.target));
        self.painter.write(panel.title, Letters::Large, [0.03, 0.91], TEXT_RGB);
        self.painter.write(panel.subtitle, Letters::Large, [0.03, 0.82], TEXT_RGB);
        self.painter.write(panel.footer, Letters::Small, [0.03, 0.03], TEXT_RGB);
    }

    /// Lines on the ground around the target, and the sky: a wall so far away that the haze hides it.
    fn marks(&self, target: [f64; 2]) -> Vec<Mark> {
        let haze_m = LINES_REACH * self.reach_m;
        let reach_m = haze_m.min(MAX_LINES as f64 / 2.0 * LINE_SPACING_M);
        let mut marks = Vec::new();
        // Lines would lie inside of bumps.
        let axes = if self.uneven_floor.is_some() { &[][..] } else { &[0, 1] };
        for &axis in axes {
            let first = ((target[axis] - reach_m) / LINE_SPACING_M).ceil() as i64;
            let last = ((target[axis] + reach_m) / LINE_SPACING_M).floor() as i64;
            for number in first..=last {
                let is_metre = axis == 0 && number % LINES_PER_METRE == 0;
                let (half_width_m, rgb) = if is_metre { (METRE_LINE_M, METRE_LINE_RGB) } else { (LINE_M, LINE_RGB) };
                let mut position = [target[0], target[1], 0.0];
                position[axis] = number as f64 * LINE_SPACING_M;
                // Wide lines are a little higher, so that they lie on the others where they cross.
                let mut half_size = [reach_m, reach_m, half_width_m / 4.0];
                half_size[axis] = half_width_m;
                marks.push(Mark { position, half_size, rgb });
            }
        }
        let distance_m = 2.0 * haze_m;
        let position = [target[0], target[1] + distance_m, 0.0];
        marks.push(Mark { position, half_size: [3.0 * distance_m, 0.1, 3.0 * distance_m], rgb: LOOK.haze_rgb });
        marks
    }
}

/// The greatest distance of anything on the robot from the body's centre in the reference configuration [m].
fn reach_m(robot: &Robot) -> f64 {
    let mut simulation = Simulation::new(&robot.model);
    simulation.update_positions();
    let (root, _) = robot.root;
    let body = &simulation.qpos()[root..root + 3];
    let geoms = simulation.geom_positions_in_world().iter().enumerate();
    let distances = geoms.filter(|(geom, _)| robot.model.is_on_robot(*geom)).map(|(geom, position)| {
        let squared: f64 = position.iter().zip(body).map(|(a, b)| (a - b) * (a - b)).sum();
        squared.sqrt() + robot.model.bounding_radius_m(geom)
    });
    distances.fold(0.0, f64::max)
}
