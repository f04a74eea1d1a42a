//! The bridge to OpenCV: conversions and errors.

use std::sync::Once;

use image::GrayImage;
use nalgebra::{Matrix3, Point2};
use opencv::boxed_ref::BoxedRef;
use opencv::core::{self, Mat, MatTraitConst, MatTraitConstManual, Point2d, Vector};
use serde::Serialize;

use picture::FloatImage;

/// OpenCV refused a call; the text is its own.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, thiserror::Error)]
#[error("OpenCV: {message}")]
pub struct OpenCvError {
    /// OpenCV's own text.
    pub message: String,
}

impl From<opencv::Error> for OpenCvError {
    fn from(error: opencv::Error) -> Self {
        Self { message: error.message }
    }
}

/// Keeps OpenCV to the calling thread. Call before any OpenCV function.
pub(super) fn single_threaded() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        // Fails only for builds without threads, which are what is wanted.
        let _ = core::set_num_threads(1);
    });
}

/// A view of `image` as a one-channel 8-bit matrix.
pub(super) fn gray_mat(image: &GrayImage) -> Result<BoxedRef<'_, Mat>, OpenCvError> {
    let (rows, cols) = (image.height() as i32, image.width() as i32);
    Ok(Mat::new_rows_cols_with_data(rows, cols, image.as_raw().as_slice())?)
}

/// A view of `image` as a one-channel float matrix.
pub(super) fn float_mat(image: &FloatImage) -> Result<BoxedRef<'_, Mat>, OpenCvError> {
    let (rows, cols) = (image.height() as i32, image.width() as i32);
    Ok(Mat::new_rows_cols_with_data(rows, cols, image.as_raw().as_slice())?)
}

pub(super) fn gray_image(mat: &Mat) -> Result<GrayImage, OpenCvError> {
    let pixels = mat.data_typed::<u8>()?.to_vec();
    GrayImage::from_raw(mat.cols() as u32, mat.rows() as u32, pixels).ok_or_else(size_mismatch)
}

pub(super) fn float_image(mat: &Mat) -> Result<FloatImage, OpenCvError> {
    let pixels = mat.data_typed::<f32>()?.to_vec();
    FloatImage::from_raw(mat.cols() as u32, mat.rows() as u32, pixels).ok_or_else(size_mismatch)
}

pub(super) fn size_mismatch() -> OpenCvError {
    OpenCvError { message: "a picture came back in another size".to_owned() }
}

pub(super) fn points(points: impl Iterator<Item = Point2<f64>>) -> Vector<Point2d> {
    points.map(|p| Point2d::new(p.x, p.y)).collect()
}

pub(super) fn matrix_mat(matrix: &Matrix3<f64>) -> Result<Mat, OpenCvError> {
    let rows: Vec<[f64; 3]> = matrix.row_iter().map(|row| [row[0], row[1], row[2]]).collect();
    Ok(Mat::from_slice_2d(&rows)?)
}

/// The 3x3 matrix in `mat`; `None` if it has another shape.
pub(super) fn matrix(mat: &Mat) -> Result<Option<Matrix3<f64>>, OpenCvError> {
    if (mat.rows(), mat.cols()) != (3, 3) {
        return Ok(None);
    }
    Ok(Some(Matrix3::from_row_slice(mat.data_typed::<f64>()?)))
}
