//! What lies on the ground: bumps, curbs and slippery patches, anew in each episode.
//!
//! Uneven ground is a height field that repeats itself. It is two periods long and wide, and follows the robot in steps of
//! one period: from wherever it walks, the robot sees the same endless ground.

use crate::keyed::{self, Purpose};
use crate::settings;
use crate::settings::Problems;
use crate::variation::interval;

settings! {
    /// What lies on the ground, anew in each episode. Lengths are in stance heights, so that one ground fits every robot.
    pub struct GroundSettings {
        /// Height of the highest possible bump above the deepest possible dent; absent: smooth.
        pub roughness: Option<f64> in 0.0..=1.0,
        /// Distance between a bump and the next dent; absent: 1.
        pub correlation_length: Option<f64> in 0.25..=12.0,
        /// Height of curbs that lie across the way; absent: none.
        pub curb_height: Option<f64> in 0.0..=1.0,
        /// Length of a curb, and of the ground between two; absent: 3.
        pub curb_length: Option<f64> in 0.25..=12.0,
        /// Least and greatest friction of square patches, as a multiple of the friction that feet have otherwise; absent: no
        /// patches.
        pub patch_friction: Option<Vec<f64>> in 0.0..=10.0,
        /// Side of a patch; absent: 3.
        pub patch_length: Option<f64> in 0.25..=100.0,
    }
}

impl GroundSettings {
    /// Nothing but what varies.
    pub fn smooth() -> Self {
        Self {
            roughness: None,
            correlation_length: None,
            curb_height: None,
            curb_length: None,
            patch_friction: None,
            patch_length: None,
        }
    }
}

/// After how many stance heights the ground repeats itself.
const PERIOD: f64 = 24.0;

/// Cells of the height field in a stance height: Doggo's feet, the smallest for its size, are about a cell wide.
const CELLS_PER_HEIGHT: usize = 8;

/// Cells in a period, each way.
const CELLS: usize = PERIOD as usize * CELLS_PER_HEIGHT;

/// What may lie on a task's ground, checked.
#[derive(Clone, Debug, PartialEq)]
pub struct Ground {
    /// Stance height of the robot [m].
    height_m: f64,
    /// Greatest roughness of any episode, in stance heights.
    max_roughness: f64,
    correlation_length: f64,
    curb_height: f64,
    curb_length: f64,
    patches: Option<Patches>,
}

/// Square patches of different friction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Patches {
    factor: [f64; 2],
    length_m: f64,
}

impl Patches {
    /// The factor of the friction at a point of the ground [m], in an episode of this key.
    pub fn factor_at(&self, [x, y]: [f64; 2], key: u64) -> f64 {
        let number = |coordinate: f64| (coordinate / self.length_m).floor() as i64 as u64 & 0x0fff_ffff;
        let [low, high] = self.factor;
        low + (high - low) * keyed::uniform(key, Purpose::Patch, (number(x) << 28) | number(y))
    }
}

impl Ground {
    /// The ground of a task whose episodes are at most this rough; what is wrong is reported at `task.ground`.
    pub(crate) fn new(settings: &GroundSettings, max_roughness: f64, height_m: f64, problems: &mut Problems) -> Self {
        let factor = settings.patch_friction.as_deref();
        let factor = factor.and_then(|factor| interval("task.ground.patch_friction", factor, problems));
        let length_m = settings.patch_length.unwrap_or(3.0) * height_m;
        Self {
            height_m,
            max_roughness,
            correlation_length: settings.correlation_length.unwrap_or(1.0),
            curb_height: settings.curb_height.unwrap_or(0.0),
            curb_length: settings.curb_length.unwrap_or(3.0),
            patches: factor.map(|factor| Patches { factor, length_m }),
        }
    }

    /// Whether there is any height to it.
    pub(crate) fn is_uneven(&self) -> bool {
        self.max_roughness > 0.0 || self.curb_height > 0.0
    }

    /// Whether an episode of this roughness depends on its key.
    pub(crate) fn needs_key(&self, roughness: f64) -> bool {
        roughness > 0.0 || self.curb_height > 0.0 || self.patches.is_some()
    }

    pub(crate) fn patches(&self) -> Option<&Patches> {
        self.patches.as_ref()
    }

    /// The height field that such ground needs.
    pub(crate) fn field(&self) -> FieldShape {
        FieldShape {
            num_points: 2 * CELLS + 1,
            half_side_m: PERIOD * self.height_m,
            top_m: (self.max_roughness + self.curb_height) * self.height_m,
            base_m: self.height_m,
        }
    }

    /// The ground of the episode with this key and roughness; none if it is even.
    pub(crate) fn relief(&self, key: u64, roughness: f64) -> Option<Relief> {
        if roughness == 0.0 && self.curb_height == 0.0 {
            return None;
        }
        let bumps = Lattice::new(PERIOD / self.correlation_length, key);
        let num_curbs = 2.0 * (PERIOD / (2.0 * self.curb_length)).round().max(1.0);
        // Which of them come first is drawn, so that a robot starts on the ground or on a curb.
        let shift = (2.0 * keyed::uniform(key, Purpose::Step, 0)).floor();
        let top = self.max_roughness + self.curb_height;
        let mut heights = Vec::with_capacity(CELLS * CELLS);
        for row in 0..CELLS {
            for column in 0..CELLS {
                let [x, y] = [column, row].map(|cell| cell as f64 / CELLS as f64);
                let curb = ((x * num_curbs).floor() + shift) % 2.0 * self.curb_height;
                let bump = if roughness > 0.0 { roughness * bumps.at(x, y) } else { 0.0 };
                heights.push(((bump + curb) / top) as f32);
            }
        }
        Some(Relief { heights, top_m: top * self.height_m, period_m: PERIOD * self.height_m })
    }
}

/// Size of a height field.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FieldShape {
    /// Points along each side.
    pub num_points: usize,
    /// Half the length of a side [m].
    pub half_side_m: f64,
    /// Height of the number 1 [m].
    pub top_m: f64,
    /// Thickness of the ground below the number 0 [m].
    pub base_m: f64,
}

/// Random heights on a square lattice that repeats itself, and smooth between its points.
struct Lattice {
    side: usize,
    heights: Vec<f64>,
}

impl Lattice {
    /// About as many points on a side as asked for.
    fn new(side: f64, key: u64) -> Self {
        let side = (side.round() as usize).clamp(1, CELLS);
        let heights = (0..(side * side) as u64).map(|i| keyed::uniform(key, Purpose::Height, i)).collect();
        Self { side, heights }
    }

    /// Height in [0, 1) at a point whose coordinates are shares of the period.
    ///
    /// ```text
    /// h = sum over the four corners of w(u) w(v) h_corner,  w(u) = u^2 (3 - 2 u)
    /// ```
    ///
    /// Source: value noise with Hermite interpolation, as usual in computer graphics.
    fn at(&self, x: f64, y: f64) -> f64 {
        let place = |share: f64| {
            let scaled = share * self.side as f64;
            let first = scaled.floor();
            let u = scaled - first;
            let first = first as usize % self.side;
            (first, (first + 1) % self.side, u * u * (3.0 - 2.0 * u))
        };
        let ((left, right, u), (low, high, v)) = (place(x), place(y));
        let along = |row: usize| {
            let [a, b] = [left, right].map(|column| self.heights[row * self.side + column]);
            a + (b - a) * u
        };
        let [a, b] = [along(low), along(high)];
        a + (b - a) * v
    }
}

/// The uneven ground of one episode.
#[derive(Clone, Debug, PartialEq)]
pub struct Relief {
    /// `(CELLS x CELLS)` one period, rows from right to left, as shares of `top_m`.
    heights: Vec<f32>,
    top_m: f64,
    period_m: f64,
}

impl Relief {
    /// Writes the height field, `(num_points x num_points)`: two periods each way, its middle at the origin.
    pub(crate) fn write(&self, field: &mut [f32]) {
        let side = 2 * CELLS + 1;
        for (row, points) in field.chunks_exact_mut(side).enumerate() {
            for (column, point) in points.iter_mut().enumerate() {
                // The origin is in the middle of the field, and at the corner of a period.
                *point = self.heights[row % CELLS * CELLS + column % CELLS];
            }
        }
    }

    /// Where the field has to lie so that the robot at `position` is near its middle: forward, left [m].
    pub(crate) fn nearest_tile(&self, position: [f64; 2]) -> [f64; 2] {
        position.map(|coordinate| (coordinate / self.period_m).round() * self.period_m)
    }

    /// Height of the ground at a point [m].
    ///
    /// ```text
    /// h = h_00 + v (h_10 - h_00) + u (h_11 - h_10)   where v > u
    /// h = h_00 + u (h_01 - h_00) + v (h_11 - h_01)   elsewhere
    /// ```
    ///
    /// u, v: place in the cell, forward and left, from 0 to 1; h_rc: height of its corner in row r, column c.
    ///
    /// Source: the two triangles of a cell that MuJoCo's collisions have.
    pub fn height_m(&self, [x, y]: [f64; 2]) -> f64 {
        let place = |coordinate: f64| {
            let cells = (coordinate / self.period_m).rem_euclid(1.0) * CELLS as f64;
            let first = cells.floor();
            (first as usize % CELLS, cells - first)
        };
        let ((column, u), (row, v)) = (place(x), place(y));
        let corner = |right: usize, up: usize| {
            f64::from(self.heights[(row + up) % CELLS * CELLS + (column + right) % CELLS]) * self.top_m
        };
        let (first, last) = (corner(0, 0), corner(1, 1));
        if v > u {
            let other = corner(0, 1);
            first + v * (other - first) + u * (last - other)
        } else {
            let other = corner(1, 0);
            first + u * (other - first) + v * (last - other)
        }
    }

    /// Least height of a sphere's surface above the ground [m].
    pub(crate) fn clearance_m(&self, [x, y, z]: [f64; 3], radius_m: f64) -> f64 {
        /// Points each way from the middle at which it is looked for.
        const POINTS: i32 = 4;
        let offsets = (-POINTS..=POINTS).map(|i| f64::from(i) / f64::from(POINTS) * radius_m);
        let mut least = f64::INFINITY;
        for dx in offsets.clone() {
            for dy in offsets.clone() {
                let below = radius_m * radius_m - dx * dx - dy * dy;
                if below >= 0.0 {
                    least = least.min(z - below.sqrt() - self.height_m([x + dx, y + dy]));
                }
            }
        }
        least
    }
}
