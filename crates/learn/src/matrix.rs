//! Matrix products: the one place that calls `gemm`.

use crate::real::Real;

/// A borrowed matrix with contiguous rows, or the transpose of one.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Matrix<'a, T> {
    values: &'a [T],
    rows: usize,
    columns: usize,
    row_stride: usize,
    column_stride: usize,
}

impl<'a, T> Matrix<'a, T> {
    /// Views `values` as `(rows x columns)`.
    ///
    /// # Panics
    /// If the length is not `rows * columns`.
    pub(crate) fn new(values: &'a [T], rows: usize, columns: usize) -> Self {
        assert_eq!(values.len(), rows * columns, "a matrix of {rows} x {columns}");
        Self { values, rows, columns, row_stride: columns, column_stride: 1 }
    }

    /// The same numbers as `(columns x rows)`.
    pub(crate) fn transposed(self) -> Self {
        Self {
            rows: self.columns,
            columns: self.rows,
            row_stride: self.column_stride,
            column_stride: self.row_stride,
            ..self
        }
    }
}

/// What becomes of the numbers that a product is written over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Previous {
    /// They are overwritten.
    Replace,
    /// The product is added to them.
    Add,
}

/// `product = left right`, or `product += left right`; always on the calling thread.
///
/// # Shapes
/// - `product`: `(left.rows x right.columns)`
///
/// # Panics
/// If the shapes do not fit.
pub(crate) fn multiply<T: Real>(product: &mut [T], previous: Previous, left: Matrix<'_, T>, right: Matrix<'_, T>) {
    assert_eq!(left.columns, right.rows, "inner sizes of a matrix product");
    assert_eq!(product.len(), left.rows * right.columns, "size of a matrix product");
    // SAFETY: the pointers come from slices; the asserts here and in `Matrix::new` keep every index that the sizes
    // and strides allow inside them; `product` is borrowed mutably, so it overlaps neither factor; T is f32 or f64,
    // which `gemm` supports.
    unsafe {
        gemm::gemm(
            left.rows,
            right.columns,
            left.columns,
            product.as_mut_ptr(),
            1,
            right.columns as isize,
            previous == Previous::Add,
            left.values.as_ptr(),
            left.column_stride as isize,
            left.row_stride as isize,
            right.values.as_ptr(),
            right.column_stride as isize,
            right.row_stride as isize,
            T::ONE,
            T::ONE,
            false,
            false,
            false,
            gemm::Parallelism::None,
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn products_agree_with_numbers_computed_by_hand() {
        // [1 2 3; 4 5 6] [1 0; 0 1; 2 1] = [7 5; 16 11]
        let left = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0];
        let right = [1.0, 0.0, 0.0, 1.0, 2.0, 1.0];
        let mut product = [100.0; 4];
        multiply(&mut product, Previous::Replace, Matrix::new(&left, 2, 3), Matrix::new(&right, 3, 2));
        assert_eq!(product, [7.0, 5.0, 16.0, 11.0]);
        multiply(&mut product, Previous::Add, Matrix::new(&left, 2, 3), Matrix::new(&right, 3, 2));
        assert_eq!(product, [14.0, 10.0, 32.0, 22.0]);
        // [1 4; 2 5; 3 6] [1 4]' = [17 22 27]'
        let mut product = [0.0; 3];
        multiply(
            &mut product,
            Previous::Replace,
            Matrix::new(&left, 2, 3).transposed(),
            Matrix::new(&[1.0, 4.0], 2, 1),
        );
        assert_eq!(product, [17.0, 22.0, 27.0]);
    }

    #[test]
    fn products_of_awkward_sizes_agree_with_the_textbook_loops() {
        for (rows, inner, columns) in [(97, 8, 64), (1, 64, 3), (33, 1, 17), (64, 128, 1), (5, 2, 70), (130, 130, 65)] {
            let left: Vec<f64> = (0..rows * inner).map(|i| ((i * 37) % 19) as f64 - 9.0).collect();
            let right: Vec<f64> = (0..inner * columns).map(|i| ((i * 53) % 23) as f64 - 11.0).collect();
            let mut product = vec![f64::NAN; rows * columns];
            let (a, b) = (Matrix::new(&left, rows, inner), Matrix::new(&right, inner, columns));
            multiply(&mut product, Previous::Replace, a, b);
            for i in 0..rows {
                for j in 0..columns {
                    let expected: f64 = (0..inner).map(|k| left[i * inner + k] * right[k * columns + j]).sum();
                    assert_eq!(product[i * columns + j], expected, "{rows} x {inner} x {columns} at {i}, {j}");
                }
            }
        }
    }
}
