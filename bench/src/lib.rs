//! What the benchmarks share: the bare physics, the unit of all costs, the task on level ground, and memory.

pub mod bare;
pub mod level;
pub mod memory;
pub mod reference;

use canter_train::statistics::quantile;

/// First quartile, median and third quartile.
pub fn quartiles(mut values: Vec<f64>) -> [f64; 3] {
    values.sort_by(f64::total_cmp);
    [0.25, 0.5, 0.75].map(|q| quantile(&values, q))
}
