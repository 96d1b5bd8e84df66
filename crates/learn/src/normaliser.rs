//! Statistics of the observations, and the normaliser that is made of them.

/// Added to every variance: a component that never changed is left nearly as it is, minus its mean.
const VARIANCE_FLOOR: f64 = 1e-8;

/// Number, mean and spread of the observations seen so far, per component.
///
/// Merging in a fixed order gives the same bytes whoever observed what, so the parts of an iteration are merged by
/// environment index.
#[derive(Clone, Debug, PartialEq)]
pub struct RunningMoments {
    /// Number of observations.
    pub count: u64,
    /// Mean, `(O)`.
    pub mean: Vec<f64>,
    /// Sum of the squared deviations from the mean, `(O)`.
    pub sum_squared_deviations: Vec<f64>,
}

impl RunningMoments {
    /// No observations yet, of O components.
    pub fn new(num_observations: usize) -> Self {
        Self { count: 0, mean: vec![0.0; num_observations], sum_squared_deviations: vec![0.0; num_observations] }
    }

    /// Forgets everything, without giving memory back.
    pub fn clear(&mut self) {
        self.count = 0;
        self.mean.fill(0.0);
        self.sum_squared_deviations.fill(0.0);
    }

    /// Adds one observation.
    ///
    /// ```text
    /// n += 1,  delta = x - mean,  mean += delta / n,  M2 += delta (x - mean)
    /// ```
    ///
    /// M2 -> `sum_squared_deviations`.
    ///
    /// # Shapes
    /// - `observation`: `(O)`, not normalised
    ///
    /// Source: Welford 1962.
    pub fn observe(&mut self, observation: &[f32]) {
        self.count += 1;
        let inverse_count = 1.0 / self.count as f64;
        for ((mean, sum), &x) in self.mean.iter_mut().zip(&mut self.sum_squared_deviations).zip(observation) {
            let delta = f64::from(x) - *mean;
            *mean += delta * inverse_count;
            *sum += delta * (f64::from(x) - *mean);
        }
    }

    /// Adds all that `other` has seen.
    ///
    /// ```text
    /// n = nA + nB,  delta = meanB - meanA,  mean = meanA + delta nB / n,  M2 = M2A + M2B + delta^2 nA nB / n
    /// ```
    ///
    /// Source: Chan, Golub and LeVeque 1979, the pairwise update.
    pub fn merge(&mut self, other: &Self) {
        if other.count == 0 {
            return;
        }
        let (count_a, count_b) = (self.count as f64, other.count as f64);
        let count = count_a + count_b;
        self.count += other.count;
        for (j, (mean, sum)) in self.mean.iter_mut().zip(&mut self.sum_squared_deviations).enumerate() {
            let delta = other.mean[j] - *mean;
            *mean += delta * count_b / count;
            *sum += other.sum_squared_deviations[j] + delta * delta * count_a * count_b / count;
        }
    }
}

/// Mean and inverse standard deviation of each component of the observation; frozen within an iteration.
#[derive(Clone, Debug, PartialEq)]
pub struct Normaliser {
    /// `(O)`, in the observation's units.
    pub mean: Vec<f32>,
    /// `(O)`, one over the observation's units.
    pub inverse_std: Vec<f32>,
}

impl Normaliser {
    /// Leaves observations as they are, but for the limit of [`canter_gait::normaliser::OBSERVATION_LIMIT`].
    pub fn identity(num_observations: usize) -> Self {
        Self { mean: vec![0.0; num_observations], inverse_std: vec![1.0; num_observations] }
    }

    /// Standardises by these statistics; with fewer than two observations it is [`identity`](Self::identity).
    ///
    /// ```text
    /// std = sqrt(M2 / n + 1e-8)
    /// ```
    ///
    /// Source: population variance; the floor is ours.
    pub fn from_moments(moments: &RunningMoments) -> Self {
        if moments.count < 2 {
            return Self::identity(moments.mean.len());
        }
        let inverse_std = |&sum: &f64| (1.0 / (sum / moments.count as f64 + VARIANCE_FLOOR).sqrt()) as f32;
        Self {
            mean: moments.mean.iter().map(|&mean| mean as f32).collect(),
            inverse_std: moments.sum_squared_deviations.iter().map(inverse_std).collect(),
        }
    }

    /// What the robot runs: the same numbers, borrowed.
    pub fn view(&self) -> canter_gait::normaliser::Normaliser<'_> {
        canter_gait::normaliser::Normaliser { mean: &self.mean, inverse_std: &self.inverse_std }
    }

    /// Writes the normalised observation.
    ///
    /// # Shapes
    /// - `raw`, `normalised`: `(O)`
    ///
    /// # Panics
    /// If their lengths differ.
    pub fn apply(&self, raw: &[f32], normalised: &mut [f32]) {
        normalised.copy_from_slice(raw);
        self.view().apply(normalised);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn moments_of(rows: &[[f32; 2]]) -> RunningMoments {
        let mut moments = RunningMoments::new(2);
        rows.iter().for_each(|row| moments.observe(row));
        moments
    }

    #[test]
    fn moments_agree_with_numbers_computed_by_hand() {
        let moments = moments_of(&[[1.0, 5.0], [2.0, 5.0], [6.0, 5.0]]);
        // mean 3, deviations -2, -1, 3: sum of squares 14
        assert_eq!((moments.count, &moments.mean[..]), (3, &[3.0, 5.0][..]));
        assert!((moments.sum_squared_deviations[0] - 14.0).abs() < 1e-12);
        assert_eq!(moments.sum_squared_deviations[1], 0.0);
    }

    #[test]
    fn merging_parts_gives_the_statistics_of_the_whole() {
        let rows: Vec<[f32; 2]> = (0..100).map(|i| [(i * 37 % 101) as f32 - 50.0, 1e3 + (i % 7) as f32]).collect();
        let whole = moments_of(&rows);
        for split in [0, 1, 30, 99, 100] {
            let mut merged = moments_of(&rows[..split]);
            merged.merge(&moments_of(&rows[split..]));
            assert_eq!(merged.count, whole.count);
            for j in 0..2 {
                assert!((merged.mean[j] / whole.mean[j] - 1.0).abs() < 1e-12);
                assert!((merged.sum_squared_deviations[j] / whole.sum_squared_deviations[j] - 1.0).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn the_normaliser_standardises_and_is_the_identity_before_any_data() {
        let normaliser = Normaliser::from_moments(&moments_of(&[[1.0, 5.0], [3.0, 5.0]]));
        let mut normalised = [0.0; 2];
        // mean 2, population std 1; a constant component becomes 0
        normaliser.apply(&[4.0, 5.0], &mut normalised);
        assert!((normalised[0] - 2.0).abs() < 1e-6 && normalised[1] == 0.0, "{normalised:?}");
        Normaliser::from_moments(&RunningMoments::new(2)).apply(&[4.0, -50.0], &mut normalised);
        assert_eq!(normalised, [4.0, -10.0]);
    }
}
