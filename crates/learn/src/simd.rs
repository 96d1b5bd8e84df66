//! Element-wise loops, compiled twice: for AVX2 where the processor has it, and for the target's baseline.
//!
//! Both run the same operations in the same order (Rust never fuses a product and a sum), so both give the same bytes.

use crate::real::Real;

/// Defines a function whose body is compiled for AVX2 too, and which picks that version at run time.
macro_rules! vectorised {
    (
        $(#[$attribute:meta])*
        $visibility:vis fn $name:ident $(<$generic:ident: $bound:ident>)? ($($argument:ident: $type:ty),* $(,)?)
        $(-> $result:ty)? $body:block
    ) => {
        $(#[$attribute])*
        $visibility fn $name $(<$generic: $bound>)? ($($argument: $type),*) $(-> $result)? {
            #[inline(always)]
            fn portable $(<$generic: $bound>)? ($($argument: $type),*) $(-> $result)? $body

            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx2")]
                fn avx2 $(<$generic: $bound>)? ($($argument: $type),*) $(-> $result)? {
                    portable($($argument),*)
                }
                if std::arch::is_x86_feature_detected!("avx2") {
                    // SAFETY: the line above found AVX2, the only feature that the function is compiled for.
                    return unsafe { avx2($($argument),*) };
                }
            }
            portable($($argument),*)
        }
    };
}
pub(crate) use vectorised;

vectorised! {
    /// `values[i] = tanh(values[i])`, with the tanh that the robot runs.
    pub(crate) fn tanh_in_place(values: &mut [f32]) {
        for value in values {
            *value = canter_gait::tanh::tanh(*value);
        }
    }
}

vectorised! {
    /// `d_loss_d_output[i] *= 1 - output[i]^2`: the gradient before a tanh from the one behind it.
    pub(crate) fn multiply_by_tanh_derivative<T: Real>(d_loss_d_output: &mut [T], output: &[T]) {
        for (d_loss, &y) in d_loss_d_output.iter_mut().zip(output) {
            *d_loss = *d_loss * (T::ONE - y * y);
        }
    }
}

vectorised! {
    /// `sum[j] += rows[i][j]`, row after row.
    pub(crate) fn add_rows<T: Real>(sum: &mut [T], rows: &[T]) {
        for row in rows.chunks_exact(sum.len()) {
            for (total, &value) in sum.iter_mut().zip(row) {
                *total += value;
            }
        }
    }
}

vectorised! {
    /// `sum[i] += terms[i]`.
    pub(crate) fn add(sum: &mut [f32], terms: &[f32]) {
        for (total, &term) in sum.iter_mut().zip(terms) {
            *total += term;
        }
    }
}

vectorised! {
    /// `values[i] *= factor`.
    pub(crate) fn scale(values: &mut [f32], factor: f32) {
        for value in values {
            *value *= factor;
        }
    }
}

/// Partial sums of [`norm`]: enough to hide the latency of an addition.
const NORM_LANES: usize = 32;

vectorised! {
    /// Euclidean norm, from partial sums that are the same on every processor.
    pub(crate) fn norm(values: &[f32]) -> f64 {
        let (chunks, rest) = values.as_chunks::<NORM_LANES>();
        let mut sums = [0.0_f32; NORM_LANES];
        for chunk in chunks {
            for (sum, &value) in sums.iter_mut().zip(chunk) {
                *sum += value * value;
            }
        }
        let rest: f64 = rest.iter().map(|&value| f64::from(value) * f64::from(value)).sum();
        (sums.iter().map(|&sum| f64::from(sum)).sum::<f64>() + rest).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn loops_agree_with_numbers_computed_by_hand() {
        let mut d_loss = [2.0, 3.0];
        multiply_by_tanh_derivative(&mut d_loss, &[0.5, -1.0]);
        assert_eq!(d_loss, [1.5, 0.0]);
        let mut sum = [1.0, 2.0];
        add_rows(&mut sum, &[10.0, 20.0, 100.0, 200.0]);
        assert_eq!(sum, [111.0, 222.0]);
        let mut values = [1.0, -2.0];
        add(&mut values, &[0.5, 0.5]);
        scale(&mut values, 2.0);
        assert_eq!(values, [3.0, -3.0]);
    }

    #[test]
    fn norm_counts_whole_chunks_and_the_rest() {
        let values: Vec<f32> = (1..=70).map(|i| i as f32).collect();
        // sum of squares 70 * 71 * 141 / 6 = 116795
        assert!((norm(&values) - 116_795.0_f64.sqrt()).abs() < 1e-6);
        assert_eq!(norm(&[3.0, -4.0]), 5.0);
        assert!(norm(&[f32::NAN]).is_nan());
    }

    #[test]
    fn tanh_of_a_slice_is_the_robots_tanh_bit_for_bit() {
        let inputs: Vec<f32> = (-500..500).map(|i| i as f32 * 0.021).collect();
        let mut outputs = inputs.clone();
        tanh_in_place(&mut outputs);
        for (x, y) in inputs.iter().zip(outputs) {
            assert_eq!(y.to_bits(), canter_gait::tanh::tanh(*x).to_bits());
        }
    }
}
