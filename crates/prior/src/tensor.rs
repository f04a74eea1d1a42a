//! Values on a grid, the channels of a place side by side.

/// Values by three axes and channel; pictures have one place along the first axis.
#[derive(Clone, Debug)]
pub(crate) struct Tensor {
    /// Places along each axis, the last one contiguous.
    pub size: [usize; 3],
    pub channels: usize,
    pub values: Vec<f32>,
}

impl Tensor {
    pub(crate) fn zeros(size: [usize; 3], channels: usize) -> Self {
        Self { size, channels, values: vec![0.0; size.iter().product::<usize>() * channels] }
    }

    /// All places along the last axis.
    pub(crate) fn row(&self, first: usize, second: usize) -> &[f32] {
        let length = self.row_length();
        &self.values[(first * self.size[1] + second) * length..][..length]
    }

    /// Values in a row along the last axis.
    pub(crate) fn row_length(&self) -> usize {
        self.size[2] * self.channels
    }
}
