//! Layers from the file of weights.

use half::f16;
use safetensors::tensor::TensorView;
use safetensors::{Dtype, SafeTensors};

use super::PriorError;
use super::convolution::{Convolution, Taps, Upsampling};

/// Named weights: `NAME.weight` as f16 with the axes in PyTorch's order, and
/// `NAME.bias` as f32.
pub(crate) struct Weights<'a>(SafeTensors<'a>);

impl<'a> Weights<'a> {
    pub(crate) fn read(bytes: &'a [u8]) -> Result<Self, PriorError> {
        SafeTensors::deserialize(bytes).map(Self).map_err(|error| wrong(&error.to_string()))
    }

    /// A convolution whose outputs are `stride` places of the input apart along
    /// the axes that its kernel has.
    pub(crate) fn convolution(&self, name: &str, stride: usize) -> Result<Convolution, PriorError> {
        let (shape, values) = self.weights(name)?;
        let [outputs, inputs, space @ ..] = &shape[..] else { return Err(wrong(name)) };
        let kernel = spatial(space, name)?;
        let count: usize = kernel.iter().product();
        let bias = self.bias(name, *outputs)?;
        let weight = |tap: usize, input: usize, output: usize| {
            values[(output * inputs + input) * count + tap]
        };
        let stride = kernel.map(|taps| if taps == 1 { 1 } else { stride });
        Ok(Convolution::new(kernel, stride, Taps::new(count, *inputs, &bias, weight)))
    }

    pub(crate) fn upsampling(&self, name: &str) -> Result<Upsampling, PriorError> {
        let (shape, values) = self.weights(name)?;
        let [inputs, outputs, space @ ..] = &shape[..] else { return Err(wrong(name)) };
        let kernel = spatial(space, name)?;
        let count: usize = kernel.iter().product();
        let bias = self.bias(name, *outputs)?;
        let weight = |tap: usize, input: usize, output: usize| {
            values[(input * outputs + output) * count + tap]
        };
        Ok(Upsampling::new(kernel, Taps::new(count, *inputs, &bias, weight)))
    }

    /// The weights of a layer as they are: its shape and values.
    pub(crate) fn weights(&self, name: &str) -> Result<(Vec<usize>, Vec<f32>), PriorError> {
        let tensor = self.tensor(&format!("{name}.weight"), Dtype::F16)?;
        let values = tensor.data().as_chunks::<2>().0.iter().map(|&pair| f16::from_le_bytes(pair));
        Ok((tensor.shape().to_vec(), values.map(f16::to_f32).collect()))
    }

    pub(crate) fn bias(&self, name: &str, outputs: usize) -> Result<Vec<f32>, PriorError> {
        let tensor = self.tensor(&format!("{name}.bias"), Dtype::F32)?;
        let values = tensor.data().as_chunks::<4>().0.iter().map(|&four| f32::from_le_bytes(four));
        let values: Vec<f32> = values.collect();
        if values.len() == outputs { Ok(values) } else { Err(wrong(name)) }
    }

    fn tensor(&self, name: &str, dtype: Dtype) -> Result<TensorView<'_>, PriorError> {
        let tensor = self.0.tensor(name).map_err(|_| wrong(name))?;
        if tensor.dtype() == dtype { Ok(tensor) } else { Err(wrong(name)) }
    }
}

fn wrong(what: &str) -> PriorError {
    PriorError::Weights(what.to_owned())
}

/// The kernel along three axes; pictures have the last two.
fn spatial(space: &[usize], name: &str) -> Result<[usize; 3], PriorError> {
    match *space {
        [rows, columns] => Ok([1, rows, columns]),
        [a, b, c] => Ok([a, b, c]),
        _ => Err(wrong(name)),
    }
}
