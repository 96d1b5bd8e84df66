//! CMA-ES: a search that learns which directions are worth trying, from the order of its candidates alone.
//!
//! Own code, because the crates that there are bring a linear-algebra library and a random generator of their own, and
//! none can be stopped and resumed to the same bytes. Names are those of Hansen 2016, "The CMA
//! Evolution Strategy: A Tutorial", arXiv 1604.00772.

use serde::{Deserialize, Serialize};

use super::eigen::symmetric_eigen;

/// No search has as many generations; twice as many do not overflow.
const MAX_GENERATION: u32 = 1 << 24;

/// Numbers that follow from the dimension n alone (Table 1, the default parameters).
#[derive(Clone, Debug, PartialEq)]
pub struct StrategyParameters {
    /// `(lambda)` weight of each candidate, best first; the worse half's are negative.
    pub weights: Vec<f64>,
    /// Candidates that the mean is made of.
    pub mu: usize,
    /// Variance-effective number of these.
    pub mu_eff: f64,
    /// Learning rate and damping of the step size.
    pub c_sigma: f64,
    /// See `c_sigma`.
    pub d_sigma: f64,
    /// Learning rate of the covariance's path.
    pub c_c: f64,
    /// Learning rate of the rank-one update.
    pub c_1: f64,
    /// Learning rate of the rank-mu update.
    pub c_mu: f64,
    /// Expected length of a standard normal vector.
    pub chi_n: f64,
}

impl StrategyParameters {
    /// The defaults for `n` dimensions, as many as are worth an eigendecomposition a generation.
    ///
    /// ```text
    /// lambda = 4 + floor(3 ln n),  w'_i = ln((lambda + 1) / 2) - ln i,  mu_eff = (sum w')^2 / sum w'^2 over i <= mu
    /// c_sigma = (mu_eff + 2) / (n + mu_eff + 5),  d_sigma = 1 + 2 max(0, sqrt((mu_eff - 1) / (n + 1)) - 1) + c_sigma
    /// c_c = (4 + mu_eff / n) / (n + 4 + 2 mu_eff / n),  c_1 = 2 / ((n + 1.3)^2 + mu_eff)
    /// c_mu = min(1 - c_1, 2 (1/4 + mu_eff + 1 / mu_eff - 2) / ((n + 2)^2 + mu_eff))
    /// E|N| = sqrt(n) (1 - 1 / (4 n) + 1 / (21 n^2))
    /// ```
    ///
    /// Source: Hansen 2016, appendix A, Table 1.
    pub fn new(n: usize) -> Self {
        let dimension = n as f64;
        let lambda = 4 + (3.0 * dimension.ln()).floor() as usize;
        let mu = lambda / 2;
        let raw: Vec<f64> = (1..=lambda).map(|i| ((lambda as f64 + 1.0) / 2.0).ln() - (i as f64).ln()).collect();
        let effective = |weights: &[f64]| {
            let sum: f64 = weights.iter().sum();
            sum * sum / weights.iter().map(|weight| weight * weight).sum::<f64>()
        };
        let (mu_eff, mu_eff_negative) = (effective(&raw[..mu]), effective(&raw[mu..]));
        let c_c = (4.0 + mu_eff / dimension) / (dimension + 4.0 + 2.0 * mu_eff / dimension);
        let c_1 = 2.0 / ((dimension + 1.3).powi(2) + mu_eff);
        let c_mu = (1.0 - c_1).min(2.0 * (0.25 + mu_eff + 1.0 / mu_eff - 2.0) / ((dimension + 2.0).powi(2) + mu_eff));
        let positive: f64 = raw.iter().filter(|weight| **weight > 0.0).sum();
        let negative: f64 = -raw.iter().filter(|weight| **weight < 0.0).sum::<f64>();
        // As much as keeps the covariance positive definite.
        let negative_scale = (1.0 + c_1 / c_mu)
            .min(1.0 + 2.0 * mu_eff_negative / (mu_eff + 2.0))
            .min((1.0 - c_1 - c_mu) / (dimension * c_mu));
        let weight = |raw: f64| if raw >= 0.0 { raw / positive } else { raw * negative_scale / negative };
        let c_sigma = (mu_eff + 2.0) / (dimension + mu_eff + 5.0);
        Self {
            weights: raw.into_iter().map(weight).collect(),
            mu,
            mu_eff,
            c_sigma,
            d_sigma: 1.0 + 2.0 * (((mu_eff - 1.0) / (dimension + 1.0)).sqrt() - 1.0).max(0.0) + c_sigma,
            c_c,
            c_1,
            c_mu,
            chi_n: dimension.sqrt() * (1.0 - 1.0 / (4.0 * dimension) + 1.0 / (21.0 * dimension * dimension)),
        }
    }

    /// Candidates of a generation.
    pub fn lambda(&self) -> usize {
        self.weights.len()
    }
}

/// The search's state between two generations.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CmaEs {
    /// `(n)` centre of the next candidates.
    pub mean: Vec<f64>,
    /// Step size.
    pub sigma: f64,
    /// Generations done.
    pub generation: u32,
    /// `(n x n)` shape of the cloud of candidates.
    covariance: Vec<f64>,
    /// `(n)` the step size's path.
    p_sigma: Vec<f64>,
    /// `(n)` the covariance's path.
    p_c: Vec<f64>,
}

impl CmaEs {
    /// A search that begins at `mean`, `(n)`, with candidates about `sigma` away in every direction.
    pub fn new(mean: Vec<f64>, sigma: f64) -> Self {
        let n = mean.len();
        let covariance = (0..n * n).map(|k| f64::from(k / n == k % n)).collect();
        Self { p_sigma: vec![0.0; n], p_c: vec![0.0; n], covariance, generation: 0, mean, sigma }
    }

    /// Whether this can be the state of a search in `n` dimensions.
    pub fn is_sound(&self, n: usize) -> bool {
        let Self { mean, sigma, generation, covariance, p_sigma, p_c } = self;
        let has_sizes = [mean.len(), p_sigma.len(), p_c.len()] == [n; 3] && covariance.len() == n * n;
        has_sizes && *sigma > 0.0 && *generation <= MAX_GENERATION
    }

    /// The next generation, `(lambda x n)`; `normal` gives standard normal numbers.
    ///
    /// ```text
    /// x = m + sigma B D z,  C = B D^2 B',  z ~ N(0, I)
    /// ```
    ///
    /// Source: Hansen 2016, appendix A: sampling.
    pub fn sample(&self, parameters: &StrategyParameters, normal: &mut dyn FnMut() -> f64) -> Vec<Vec<f64>> {
        let n = self.mean.len();
        let (variances, basis) = self.decompose();
        let candidate = |_| {
            let scaled: Vec<f64> = variances.iter().map(|variance| variance.sqrt() * normal()).collect();
            (0..n).map(|i| self.mean[i] + self.sigma * dot(&basis[i * n..(i + 1) * n], &scaled)).collect()
        };
        (0..parameters.lambda()).map(candidate).collect()
    }

    /// Learns from a generation, `(lambda x n)`, best candidate first.
    ///
    /// ```text
    /// y_i = (x_i - m) / sigma,  <y> = sum_(i <= mu) w_i y_i,  m <- m + sigma <y>
    /// p_sigma <- (1 - c_sigma) p_sigma + sqrt(c_sigma (2 - c_sigma) mu_eff) C^(-1/2) <y>
    /// sigma <- sigma exp(c_sigma / d_sigma (|p_sigma| / E|N| - 1))
    /// p_c <- (1 - c_c) p_c + h sqrt(c_c (2 - c_c) mu_eff) <y>
    /// C <- (1 + c_1 (1 - h) c_c (2 - c_c) - c_1 - c_mu sum w) C + c_1 p_c p_c' + c_mu sum w_i° y_i y_i'
    /// w_i° = w_i for w_i >= 0, else w_i n / |C^(-1/2) y_i|^2
    /// h = 1 if |p_sigma| / sqrt(1 - (1 - c_sigma)^(2 (g + 1))) < (1.4 + 2 / (n + 1)) E|N|, else 0
    /// ```
    ///
    /// Source: Hansen 2016, appendix A: selection and recombination, step-size control, covariance matrix adaptation.
    pub fn update(&mut self, parameters: &StrategyParameters, ranked: &[Vec<f64>]) {
        let n = self.mean.len();
        let StrategyParameters { weights, mu, mu_eff, c_sigma, d_sigma, c_c, c_1, c_mu, chi_n } = parameters;
        let (variances, basis) = self.decompose();
        // C^(-1/2) y = B D^-1 B' y
        let whiten = |y: &[f64]| -> Vec<f64> {
            let along = |j: usize| (0..n).map(|i| basis[i * n + j] * y[i]).sum::<f64>() / variances[j].sqrt();
            let scaled: Vec<f64> = (0..n).map(along).collect();
            (0..n).map(|i| dot(&basis[i * n..(i + 1) * n], &scaled)).collect()
        };
        let steps: Vec<Vec<f64>> =
            ranked.iter().map(|x| x.iter().zip(&self.mean).map(|(x, m)| (x - m) / self.sigma).collect()).collect();
        let mean_step: Vec<f64> =
            (0..n).map(|i| steps[..*mu].iter().zip(weights).map(|(y, w)| w * y[i]).sum()).collect();
        for (m, y) in self.mean.iter_mut().zip(&mean_step) {
            *m += self.sigma * y;
        }

        let gain = (c_sigma * (2.0 - c_sigma) * mu_eff).sqrt();
        for (p, y) in self.p_sigma.iter_mut().zip(whiten(&mean_step)) {
            *p = (1.0 - c_sigma) * *p + gain * y;
        }
        let length = dot(&self.p_sigma, &self.p_sigma).sqrt();
        let settled = (1.0 - (1.0 - c_sigma).powi(2 * (self.generation as i32 + 1))).sqrt();
        let h = f64::from(length / settled < (1.4 + 2.0 / (n as f64 + 1.0)) * chi_n);
        let gain = (c_c * (2.0 - c_c) * mu_eff).sqrt();
        for (p, y) in self.p_c.iter_mut().zip(&mean_step) {
            *p = (1.0 - c_c) * *p + h * gain * y;
        }

        let kept = 1.0 + c_1 * (1.0 - h) * c_c * (2.0 - c_c) - c_1 - c_mu * weights.iter().sum::<f64>();
        let balanced: Vec<f64> = weights
            .iter()
            .zip(&steps)
            .map(|(&weight, y)| {
                let white = whiten(y);
                if weight >= 0.0 { weight } else { weight * n as f64 / dot(&white, &white).max(f64::MIN_POSITIVE) }
            })
            .collect();
        for i in 0..n {
            for j in 0..n {
                let rank_mu: f64 = balanced.iter().zip(&steps).map(|(weight, y)| weight * y[i] * y[j]).sum();
                let old = self.covariance[i * n + j];
                self.covariance[i * n + j] = kept * old + c_1 * self.p_c[i] * self.p_c[j] + c_mu * rank_mu;
            }
        }
        self.sigma *= (c_sigma / d_sigma * (length / chi_n - 1.0)).exp();
        self.generation += 1;
    }

    /// Eigenvalues, `(n)`, and eigenvectors, `(n x n)`, of the covariance.
    fn decompose(&self) -> (Vec<f64>, Vec<f64>) {
        let (mut variances, basis) = symmetric_eigen(&self.covariance, self.mean.len());
        // Where all candidates were moved onto the same side of a box, rounding may take a variance below 0.
        let least = f64::EPSILON * variances.iter().copied().fold(0.0, f64::max);
        variances.iter_mut().for_each(|variance| *variance = variance.max(least));
        (variances, basis)
    }
}

/// The point of [-1, 1] that a number stands for, so that a search without bounds searches a box.
///
/// The number line is folded at the bounds. There a search without bounds sees an ordinary optimum, while moving
/// candidates onto the bound would distort what it learns of its step size.
///
/// ```text
/// fold(x) = 1 - |((x + 1) mod 4) - 2|
/// ```
///
/// Source: reflection in Wessing 2013, "Repair Methods for Box Constraints Revisited".
pub fn fold(x: f64) -> f64 {
    1.0 - ((x + 1.0).rem_euclid(4.0) - 2.0).abs()
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
mod tests {
    use canter_learn::random::{Purpose, stream};

    use super::*;
    use crate::search::tuned::standard_normal;

    /// The search after `generations` from `start`.
    fn minimise(start: &[f64], generations: u64, value: impl Fn(&[f64]) -> f64) -> CmaEs {
        let parameters = StrategyParameters::new(start.len());
        let mut search = CmaEs::new(start.to_vec(), 0.5);
        for generation in 0..generations {
            let mut rng = stream(1, Purpose::Search, 0, generation);
            let mut candidates = search.sample(&parameters, &mut || standard_normal(&mut rng));
            candidates.sort_by(|a, b| value(a).total_cmp(&value(b)));
            search.update(&parameters, &candidates);
        }
        search
    }

    #[test]
    fn default_parameters_by_hand() {
        let parameters = StrategyParameters::new(10);
        assert_eq!((parameters.lambda(), parameters.mu), (10, 5));
        // w' = 1.7047, 1.0116, 0.6061, 0.3185, 0.0953: sum 3.7363, sum of squares 4.4074.
        assert!((parameters.mu_eff - 3.1673).abs() < 1e-3, "{}", parameters.mu_eff);
        assert!((parameters.weights[0] - 1.7047 / 3.7363).abs() < 1e-4);
        assert!((parameters.weights[..5].iter().sum::<f64>() - 1.0).abs() < 1e-12);
        assert!(parameters.weights[5..].iter().all(|weight| *weight < 0.0));
        // (3.1673 + 2) / (10 + 3.1673 + 5)
        assert!((parameters.c_sigma - 0.28443).abs() < 1e-4);
        assert!((parameters.d_sigma - 1.28443).abs() < 1e-4);
        // (4 + 0.31673) / (14 + 0.63346)
        assert!((parameters.c_c - 0.29499).abs() < 1e-4);
        // 2 / (11.3^2 + 3.1673)
        assert!((parameters.c_1 - 0.015283).abs() < 1e-5);
        // 2 (0.25 + 3.1673 + 0.31573 - 2) / (144 + 3.1673)
        assert!((parameters.c_mu - 0.023552).abs() < 1e-5, "{}", parameters.c_mu);
        assert!((parameters.chi_n - 3.0847).abs() < 1e-3);
        assert_eq!(StrategyParameters::new(17).lambda(), 12);
    }

    #[test]
    fn the_sphere() {
        let search = minimise(&[3.0; 10], 300, |x| dot(x, x));
        assert!(dot(&search.mean, &search.mean) < 1e-12, "{:?}", search.mean);
        assert!(search.sigma < 1e-5);
    }

    #[test]
    fn an_ellipsoid_with_axes_of_1_to_1000() {
        let value = |x: &[f64]| -> f64 {
            let weight = |i: usize| 1e6_f64.powf(i as f64 / (x.len() - 1) as f64);
            // Turned by 45 degrees in the first plane, so that no axis is a coordinate.
            let turned = [(x[0] + x[1]) / 2.0_f64.sqrt(), (x[0] - x[1]) / 2.0_f64.sqrt()];
            turned.iter().chain(&x[2..]).enumerate().map(|(i, x)| weight(i) * x * x).sum()
        };
        let search = minimise(&[1.0; 8], 500, value);
        assert!(value(&search.mean) < 1e-9, "{:?}", search.mean);
    }

    #[test]
    fn rosenbrocks_valley() {
        let value = |x: &[f64]| -> f64 {
            x.windows(2).map(|x| 100.0 * (x[1] - x[0] * x[0]).powi(2) + (1.0 - x[0]).powi(2)).sum()
        };
        let search = minimise(&[0.0; 6], 700, value);
        assert!(search.mean.iter().all(|x| (x - 1.0).abs() < 1e-4), "{:?}", search.mean);
    }

    #[test]
    fn an_optimum_outside_the_box_is_found_on_its_side() {
        let value = |x: &[f64]| {
            let x: Vec<f64> = x.iter().map(|&x| fold(x)).collect();
            (x[0] - 2.0).powi(2) + (x[1] + 2.0).powi(2) + x[2..].iter().map(|x| x * x).sum::<f64>()
        };
        let search = minimise(&[0.0; 6], 200, value);
        for (x, expected) in search.mean.iter().zip([1.0, -1.0, 0.0, 0.0, 0.0, 0.0]) {
            assert!((fold(*x) - expected).abs() < 1e-3, "{:?}", search.mean);
        }
    }

    #[test]
    fn folding_by_hand() {
        for (x, expected) in [(0.3, 0.3), (1.0, 1.0), (1.2, 0.8), (-1.5, -0.5), (3.0, -1.0), (4.1, 0.1), (-3.0, 1.0)] {
            assert!((fold(x) - expected).abs() < 1e-12, "{x}: {}", fold(x));
        }
    }

    #[test]
    fn a_search_that_was_written_down_goes_on_with_the_same_bytes() {
        let search = minimise(&[3.0; 5], 7, |x| dot(x, x));
        let text = serde_json::to_string(&search).unwrap();
        assert_eq!(serde_json::from_str::<CmaEs>(&text).unwrap(), search);
    }
}
