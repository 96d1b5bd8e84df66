//! Eigenvalues of a small symmetric matrix.

/// Sweeps over all pairs after which the rotations have long converged; 6 to 10 are usual.
const MAX_SWEEPS: usize = 60;

/// Eigenvalues, `(n)`, and eigenvectors, `(n x n)`, one a column, of a symmetric matrix.
///
/// Rotations make one element after the other zero, until the sum of their squares no longer counts beside the
/// diagonal's.
///
/// ```text
/// A <- J' A J,  V <- V J;  tan(2 phi) = 2 a_pq / (a_qq - a_pp)
/// ```
///
/// Source: Golub and Van Loan 2013, section 8.5.3 (cyclic Jacobi).
///
/// # Shapes
/// - `matrix`: `(n x n)`, row by row; only its symmetric part is used
pub fn symmetric_eigen(matrix: &[f64], n: usize) -> (Vec<f64>, Vec<f64>) {
    let at = |i: usize, j: usize| i * n + j;
    let mut a: Vec<f64> = (0..n * n).map(|k| 0.5 * (matrix[k] + matrix[at(k % n, k / n)])).collect();
    let mut vectors = vec![0.0; n * n];
    (0..n).for_each(|i| vectors[at(i, i)] = 1.0);
    for _ in 0..MAX_SWEEPS {
        let pairs = || (0..n).flat_map(|p| (p + 1..n).map(move |q| (p, q)));
        let off_diagonal: f64 = pairs().map(|(p, q)| a[at(p, q)] * a[at(p, q)]).sum();
        let diagonal: f64 = (0..n).map(|i| a[at(i, i)] * a[at(i, i)]).sum();
        if off_diagonal <= f64::EPSILON * f64::EPSILON * diagonal {
            break;
        }
        for (p, q) in pairs() {
            let a_pq = a[at(p, q)];
            if a_pq == 0.0 {
                continue;
            }
            let tau = (a[at(q, q)] - a[at(p, p)]) / (2.0 * a_pq);
            // The smaller of the two angles, for its numerical error.
            let tan = tau.signum() / (tau.abs() + tau.hypot(1.0));
            let cos = 1.0 / tan.hypot(1.0);
            let sin = tan * cos;
            let rotate = |values: &mut [f64], first: usize, second: usize| {
                let (x, y) = (values[first], values[second]);
                values[first] = cos * x - sin * y;
                values[second] = sin * x + cos * y;
            };
            for k in 0..n {
                rotate(&mut a, at(k, p), at(k, q));
                rotate(&mut vectors, at(k, p), at(k, q));
            }
            for k in 0..n {
                rotate(&mut a, at(p, k), at(q, k));
            }
        }
    }
    ((0..n).map(|i| a[at(i, i)]).collect(), vectors)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn column(vectors: &[f64], n: usize, j: usize) -> Vec<f64> {
        (0..n).map(|i| vectors[i * n + j]).collect()
    }

    #[test]
    fn two_by_two_by_hand() {
        // [[2, 1], [1, 2]]: 1 along (1, -1), 3 along (1, 1).
        let (values, vectors) = symmetric_eigen(&[2.0, 1.0, 1.0, 2.0], 2);
        let largest = if values[0] > values[1] { 0 } else { 1 };
        assert!((values[largest] - 3.0).abs() < 1e-12 && (values[1 - largest] - 1.0).abs() < 1e-12);
        let vector = column(&vectors, 2, largest);
        assert!((vector[0] - vector[1]).abs() < 1e-12 && (vector[0].abs() - 0.5_f64.sqrt()).abs() < 1e-12);
    }

    #[test]
    fn forty_dimensions_decompose_into_orthogonal_vectors() {
        let n = 40;
        // The Hilbert matrix is symmetric and has eigenvalues over many decades.
        let matrix: Vec<f64> = (0..n * n).map(|k| 1.0 / (k / n + k % n + 1) as f64).collect();
        let (values, vectors) = symmetric_eigen(&matrix, n);
        for (j, value) in values.iter().enumerate() {
            let v = column(&vectors, n, j);
            for i in 0..n {
                let product: f64 = (0..n).map(|k| matrix[i * n + k] * v[k]).sum();
                assert!((product - value * v[i]).abs() < 1e-13, "{i} {j}");
            }
            for other in 0..n {
                let dot: f64 = v.iter().zip(column(&vectors, n, other)).map(|(a, b)| a * b).sum();
                assert!((dot - f64::from(j == other)).abs() < 1e-12, "{j} {other}");
            }
        }
        let trace: f64 = (0..n).map(|i| matrix[i * n + i]).sum();
        assert!((values.iter().sum::<f64>() - trace).abs() < 1e-12);
    }

    #[test]
    fn a_diagonal_matrix_is_left_alone() {
        let (values, vectors) = symmetric_eigen(&[3.0, 0.0, 0.0, -1.0], 2);
        assert_eq!((values, vectors), (vec![3.0, -1.0], vec![1.0, 0.0, 0.0, 1.0]));
    }
}
