//! Convolutions, the same bytes on every processor.
//!
//! Each output is one chain of fused multiply-adds in a fixed order, over taps
//! and then over inputs; vectors hold different outputs. How wide they are, and
//! how many threads share the rows, changes no bit. Processors without fused
//! multiply-add do it in software.

use std::array;

use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;

use super::tensor::Tensor;

/// Outputs that are summed side by side.
const LANES: usize = 16;

/// A convolution with its bias: of one tap, or of an odd number along each
/// axis and zeros around.
#[derive(Debug)]
pub(crate) struct Convolution {
    /// Taps along each axis.
    kernel: [usize; 3],
    /// Places of the input from output to output.
    stride: [usize; 3],
    taps: Taps,
}

/// A transposed convolution with its bias, whose taps do not overlap.
#[derive(Debug)]
pub(crate) struct Upsampling {
    /// Taps, and places of the output a place of the input.
    kernel: [usize; 3],
    taps: Taps,
}

/// What is done to sums in the end.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ending<'a> {
    /// Is added.
    pub skip: Option<&'a Tensor>,
    /// Whether negative values become 0.
    pub relu: bool,
}

/// Weights by tap, block of [`LANES`] outputs, input, output.
#[derive(Debug)]
pub(crate) struct Taps {
    inputs: usize,
    outputs: usize,
    weights: Vec<[f32; LANES]>,
    /// By output, filled up to whole blocks.
    bias: Vec<f32>,
}

impl Taps {
    /// * `count`: taps.
    /// * `weight`: that of a tap, an input and an output.
    pub(crate) fn new(
        count: usize,
        inputs: usize,
        bias: &[f32],
        weight: impl Fn(usize, usize, usize) -> f32,
    ) -> Self {
        let outputs = bias.len();
        let blocks = outputs.div_ceil(LANES);
        let mut weights = Vec::with_capacity(count * blocks * inputs);
        for tap in 0..count {
            for block in 0..blocks {
                for input in 0..inputs {
                    weights.push(array::from_fn(|lane| {
                        let output = block * LANES + lane;
                        if output < outputs { weight(tap, input, output) } else { 0.0 }
                    }));
                }
            }
        }
        let mut bias = bias.to_vec();
        bias.resize(blocks * LANES, 0.0);
        Self { inputs, outputs, weights, bias }
    }

    /// Outputs with what fills up the last block.
    fn width(&self) -> usize {
        self.bias.len()
    }

    /// The weights of a tap, one block after the other.
    fn tap(&self, tap: usize) -> &[[f32; LANES]] {
        let length = self.width() / LANES * self.inputs;
        &self.weights[tap * length..][..length]
    }

    fn begin(&self, sums: &mut [f32]) {
        sums.chunks_exact_mut(self.width()).for_each(|sums| sums.copy_from_slice(&self.bias));
    }

    /// Adds what one tap gives to `count` places.
    ///
    /// * `steps`: values from place to place in `sums` and in `source`.
    fn add(
        &self,
        arch: Arch,
        tap: usize,
        count: usize,
        sums: &mut [f32],
        source: &[f32],
        steps: [usize; 2],
    ) {
        let (inputs, weights) = (self.inputs, self.tap(tap));
        arch.dispatch(Products { inputs, weights, count, sums, source, steps });
    }

    /// The rows of a tensor of `size`, each from the bias and what `sum` adds to
    /// its sums; `room` is what the rows of one thread share.
    fn rows<R>(
        &self,
        size: [usize; 3],
        ending: Ending<'_>,
        room: impl Fn() -> R + Sync + Send,
        sum: impl Fn(&mut R, [usize; 2], &mut [f32]) + Sync + Send,
    ) -> Tensor {
        let mut out = Tensor::zeros(size, self.outputs);
        let length = out.row_length().max(1);
        out.values.par_chunks_exact_mut(length).enumerate().for_each_init(
            || (room(), vec![0.0; size[2] * self.width()]),
            |(room, sums), (index, out)| {
                let row = [index / size[1], index % size[1]];
                self.begin(sums);
                sum(room, row, sums);
                let skip = ending.skip.map(|skip| skip.row(row[0], row[1]));
                self.finish(sums, skip, ending.relu, out);
            },
        );
        out
    }

    /// What the sums of a row are in the end.
    fn finish(&self, sums: &[f32], skip: Option<&[f32]>, relu: bool, out: &mut [f32]) {
        let own = out.chunks_exact_mut(self.outputs).zip(sums.chunks_exact(self.width()));
        own.for_each(|(out, sums)| out.copy_from_slice(&sums[..self.outputs]));
        if let Some(skip) = skip {
            out.iter_mut().zip(skip).for_each(|(out, skip)| *out += skip);
        }
        if relu {
            out.iter_mut().for_each(|out| *out = out.max(0.0));
        }
    }
}

/// What one tap adds to a row of places, with the processor's widest vectors.
struct Products<'a> {
    inputs: usize,
    weights: &'a [[f32; LANES]],
    count: usize,
    sums: &'a mut [f32],
    source: &'a [f32],
    steps: [usize; 2],
}

impl WithSimd for Products<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        /// With as many registers two blocks of outputs find room.
        const MANY_REGISTERS: usize = 32;
        if S::REGISTER_COUNT >= MANY_REGISTERS { self.add::<2>() } else { self.add::<1>() }
    }
}

impl Products<'_> {
    /// So many blocks of outputs side by side, then those that are left.
    #[inline(always)]
    fn add<const BLOCKS: usize>(self) {
        let Self { inputs, weights, count, sums, source, steps } = self;
        let of_block = |block: usize| &weights[block * inputs..][..inputs];
        let blocks = weights.len() / inputs;
        let whole = blocks / BLOCKS * BLOCKS;
        for block in (0..whole).step_by(BLOCKS) {
            let own: [_; BLOCKS] = array::from_fn(|n| of_block(block + n));
            along(own, count, &mut sums[block * LANES..], source, steps);
        }
        for block in whole..blocks {
            along([of_block(block)], count, &mut sums[block * LANES..], source, steps);
        }
    }
}

/// Adds the products of blocks of weights with the inputs of `count` places.
#[inline(always)]
fn along<const BLOCKS: usize>(
    weights: [&[[f32; LANES]]; BLOCKS],
    count: usize,
    sums: &mut [f32],
    source: &[f32],
    steps: [usize; 2],
) {
    /// Places that are summed side by side.
    const PLACES: usize = 4;
    let at = |place: usize| [place * steps[0], place * steps[1]];
    let whole = count / PLACES * PLACES;
    for [sum, input] in (0..whole).step_by(PLACES).map(at) {
        accumulate::<PLACES, BLOCKS>(weights, &mut sums[sum..], &source[input..], steps);
    }
    for [sum, input] in (whole..count).map(at) {
        accumulate::<1, BLOCKS>(weights, &mut sums[sum..], &source[input..], steps);
    }
}

#[inline(always)]
fn accumulate<const PLACES: usize, const BLOCKS: usize>(
    weights: [&[[f32; LANES]]; BLOCKS],
    sums: &mut [f32],
    source: &[f32],
    steps: [usize; 2],
) {
    let count = weights[0].len();
    let mut own: [[[f32; LANES]; BLOCKS]; PLACES] = array::from_fn(|place| {
        let sums = &sums[place * steps[0]..][..BLOCKS * LANES];
        array::from_fn(|block| array::from_fn(|lane| sums[block * LANES + lane]))
    });
    let inputs: [&[f32]; PLACES] = array::from_fn(|place| &source[place * steps[1]..][..count]);
    for input in 0..count {
        let weights: [[f32; LANES]; BLOCKS] = array::from_fn(|block| weights[block][input]);
        for (own, inputs) in own.iter_mut().zip(&inputs) {
            let value = inputs[input];
            for (own, weights) in own.iter_mut().zip(&weights) {
                for (sum, weight) in own.iter_mut().zip(weights) {
                    *sum = value.mul_add(*weight, *sum);
                }
            }
        }
    }
    for (place, own) in own.iter().enumerate() {
        let sums = &mut sums[place * steps[0]..][..BLOCKS * LANES];
        sums.as_chunks_mut::<LANES>().0.iter_mut().zip(own).for_each(|(sums, own)| *sums = *own);
    }
}

impl Convolution {
    pub(crate) fn new(kernel: [usize; 3], stride: [usize; 3], taps: Taps) -> Self {
        Self { kernel, stride, taps }
    }

    pub(crate) fn outputs(&self) -> usize {
        self.taps.outputs
    }

    /// The convolution of `input`, on rayon's current pool.
    pub(crate) fn run(&self, input: &Tensor, ending: Ending<'_>) -> Tensor {
        // Along each axis the middle of the kernel stands on a place.
        let size = array::from_fn(|axis| (input.size[axis] - 1) / self.stride[axis] + 1);
        let beyond = self.kernel[2] / 2 * input.channels;
        let arch = Arch::new();
        let padded = || vec![0.0; input.row_length() + 2 * beyond];
        self.taps.rows(size, ending, padded, |padded, row, sums| {
            for first in 0..self.kernel[0] {
                for second in 0..self.kernel[1] {
                    let at = |axis: usize, tap: usize| {
                        (row[axis] * self.stride[axis] + tap)
                            .checked_sub(self.kernel[axis] / 2)
                            .filter(|&place| place < input.size[axis])
                    };
                    let (Some(a), Some(b)) = (at(0, first), at(1, second)) else { continue };
                    padded[beyond..][..input.row_length()].copy_from_slice(input.row(a, b));
                    for third in 0..self.kernel[2] {
                        let tap = (first * self.kernel[1] + second) * self.kernel[2] + third;
                        let source = &padded[third * input.channels..];
                        let steps = [self.taps.width(), self.stride[2] * input.channels];
                        self.taps.add(arch, tap, size[2], sums, source, steps);
                    }
                }
            }
        })
    }

    /// Applies a convolution of one tap to places side by side; `out` takes
    /// its outputs, negative ones as 0 if `relu`.
    pub(crate) fn pointwise(&self, input: &[f32], relu: bool, out: &mut [f32]) {
        let Taps { inputs, .. } = self.taps;
        let (count, width) = (input.len() / inputs, self.taps.width());
        let mut sums = vec![0.0; count * width];
        self.taps.begin(&mut sums);
        self.taps.add(Arch::new(), 0, count, &mut sums, input, [width, inputs]);
        self.taps.finish(&sums, None, relu, out);
    }
}

impl Upsampling {
    pub(crate) fn new(kernel: [usize; 3], taps: Taps) -> Self {
        Self { kernel, taps }
    }

    /// The transposed convolution of `input`, on rayon's current pool.
    pub(crate) fn run(&self, input: &Tensor, ending: Ending<'_>) -> Tensor {
        let size = array::from_fn(|axis| input.size[axis] * self.kernel[axis]);
        let (arch, width) = (Arch::new(), self.taps.width());
        self.taps.rows(
            size,
            ending,
            || (),
            |(), row, sums| {
                let source = input.row(row[0] / self.kernel[0], row[1] / self.kernel[1]);
                let tap = row[0] % self.kernel[0] * self.kernel[1] + row[1] % self.kernel[1];
                for third in 0..self.kernel[2] {
                    let (tap, sums) = (tap * self.kernel[2] + third, &mut sums[third * width..]);
                    let steps = [self.kernel[2] * width, input.channels];
                    self.taps.add(arch, tap, input.size[2], sums, source, steps);
                }
            },
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Small values that differ.
    fn value(index: usize) -> f32 {
        ((index * 2_654_435_761) % 1000) as f32 / 500.0 - 1.0
    }

    fn filled(size: [usize; 3], channels: usize) -> Tensor {
        let mut tensor = Tensor::zeros(size, channels);
        tensor.values.iter_mut().enumerate().for_each(|(index, own)| *own = value(index));
        tensor
    }

    fn layer(kernel: [usize; 3], stride: [usize; 3], inputs: usize, outputs: usize) -> Convolution {
        let bias: Vec<f32> = (0..outputs).map(|index| value(index + 7)).collect();
        let count = kernel.iter().product();
        let weight = |tap, input, output| value(tap * 1000 + input * 37 + output);
        Convolution::new(kernel, stride, Taps::new(count, inputs, &bias, weight))
    }

    /// By the definition, in the same order.
    fn plainly(layer: &Convolution, input: &Tensor) -> Vec<f32> {
        let size: [usize; 3] =
            array::from_fn(|axis| (input.size[axis] - 1) / layer.stride[axis] + 1);
        let mut out = Vec::new();
        for index in 0..size.iter().product::<usize>() {
            let place = [index / size[2] / size[1], index / size[2] % size[1], index % size[2]];
            for output in 0..layer.outputs() {
                let mut sum = value(output + 7);
                for tap in 0..layer.kernel.iter().product() {
                    let [_, b, c] = layer.kernel;
                    let taps = [tap / c / b, tap / c % b, tap % c];
                    let at: [Option<usize>; 3] = array::from_fn(|axis| {
                        (place[axis] * layer.stride[axis] + taps[axis])
                            .checked_sub(layer.kernel[axis] / 2)
                            .filter(|&at| at < input.size[axis])
                    });
                    let [Some(a), Some(b), Some(c)] = at else { continue };
                    let source = &input.row(a, b)[c * input.channels..][..input.channels];
                    for (index, own) in source.iter().enumerate() {
                        sum = own.mul_add(value(tap * 1000 + index * 37 + output), sum);
                    }
                }
                out.push(sum.max(0.0));
            }
        }
        out
    }

    #[test]
    fn every_bit_is_that_of_the_definition() {
        let relu = Ending { skip: None, relu: true };
        for (size, kernel, stride, inputs, outputs) in [
            ([5, 6, 11], [3, 3, 3], [1, 1, 1], 7, 20),
            ([5, 6, 11], [3, 3, 3], [2, 2, 2], 16, 33),
            ([1, 9, 23], [1, 5, 5], [1, 2, 2], 2, 16),
            ([2, 3, 4], [1, 1, 1], [1, 1, 1], 5, 1),
        ] {
            let (input, layer) = (filled(size, inputs), layer(kernel, stride, inputs, outputs));
            let bits = |values: &[f32]| values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
            let found = layer.run(&input, relu);
            assert_eq!(bits(&found.values), bits(&plainly(&layer, &input)), "{kernel:?}");
        }
    }

    #[test]
    fn one_tap_needs_no_grid() {
        let (input, layer) = (filled([1, 1, 13], 6), layer([1, 1, 1], [1, 1, 1], 6, 19));
        let mut out = vec![0.0; 13 * 19];
        layer.pointwise(&input.values, true, &mut out);
        assert_eq!(out, layer.run(&input, Ending { skip: None, relu: true }).values);
    }

    #[test]
    fn upsampling_spreads_each_place_over_its_own() {
        let weight = |tap, input, output| value(tap * 100 + input * 10 + output);
        let layer = Upsampling::new([2, 2, 2], Taps::new(8, 3, &[0.5, -0.5], weight));
        let (input, skip) = (filled([2, 3, 5], 3), filled([4, 6, 10], 2));
        let found = layer.run(&input, Ending { skip: Some(&skip), relu: false });
        assert_eq!(found.size, [4, 6, 10]);
        // Place (3, 4, 7) is of place (1, 2, 3), tap (1, 0, 1).
        let source = &input.row(1, 2)[9..12];
        let sum = (0..3).fold(-0.5, |sum, index| source[index].mul_add(weight(5, index, 1), sum));
        assert_eq!(found.row(3, 4)[15], sum + skip.row(3, 4)[15]);
    }
}
