//! The two graphs and their weights.

use std::sync::Arc;

use tract_linalg::multithread::{Executor, multithread_tract_scope};
use tract_onnx::pb::ModelProto;
use tract_onnx::prelude::*;

use super::lifting::{EXTRAS, Lifted};
use super::sampling::{Sampled, UP};
use super::{Grid, PriorError};

/// Features a view and voxel.
pub(crate) const FEATURES: usize = 24;

const ENCODER: &[u8] = include_bytes!("../weights/encoder.onnx");
const VOLUME: &[u8] = include_bytes!("../weights/volume.onnx");

/// Both graphs as read; they are fitted to a grid when it is known.
pub(crate) struct Network {
    encoder: ModelProto,
    volume: ModelProto,
}

type Plan = Arc<TypedRunnableModel>;

/// The encoder for one size of drawings.
pub(crate) struct Encoder {
    plan: Plan,
}

fn failed(error: impl std::fmt::Display) -> PriorError {
    PriorError::Network(error.to_string())
}

impl Network {
    pub(crate) fn load() -> Result<Self, PriorError> {
        let read = |bytes: &[u8]| tract_onnx::onnx().proto_model_for_read(&mut &bytes[..]);
        Ok(Self { encoder: read(ENCODER).map_err(failed)?, volume: read(VOLUME).map_err(failed)? })
    }

    /// The encoder for the drawings of `grid`.
    pub(crate) fn encoder(&self, grid: &Grid) -> Result<Encoder, PriorError> {
        let shape = [1, 2, grid.size[2] * UP, grid.view_columns() * UP];
        Ok(Encoder { plan: plan(&self.encoder, &[&shape])? })
    }

    /// Logits at twice the grid, eight channels a voxel, by Y, X, Z.
    pub(crate) fn volume(
        &self,
        grid: &Grid,
        views: usize,
        lifted: Lifted,
    ) -> Result<Vec<f32>, PriorError> {
        let [nx, ny, nz] = grid.size;
        let shapes: [&[usize]; 3] =
            [&[views, FEATURES, ny, nx, nz], &[views, 4, ny, nx, 1], &[1, EXTRAS, ny, nx, nz]];
        let plan = plan(&self.volume, &shapes)?;
        // tract holds thread-local scratch while rayon waits: in a pool of its own
        // no other inference can be taken up meanwhile on the same thread.
        let threads = rayon::current_num_threads();
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().map_err(failed)?;
        pool.install(|| {
            let inputs = shapes.iter().zip([lifted.features, lifted.position, lifted.extra]);
            let inputs =
                inputs.map(|(shape, values)| tensor(shape, values)).collect::<Result<_, _>>()?;
            run(&plan, inputs, Executor::RayonGlobal)
        })
    }
}

impl Encoder {
    /// Features by channel, row and column of voxels.
    pub(crate) fn features(&self, image: &Sampled) -> Result<Vec<f32>, PriorError> {
        let input = tensor(&[1, 2, image.rows, image.columns], image.values.clone())?;
        // Views run side by side: each on one thread.
        run(&self.plan, tvec![input], Executor::SingleThread)
    }
}

fn plan(graph: &ModelProto, shapes: &[&[usize]]) -> Result<Plan, PriorError> {
    let build = || -> TractResult<Plan> {
        let mut model = tract_onnx::onnx().model_for_proto_model(graph)?;
        for (input, shape) in shapes.iter().enumerate() {
            model.set_input_fact(input, f32::fact(*shape).into())?;
        }
        model.into_optimized()?.into_runnable()
    };
    build().map_err(failed)
}

fn tensor(shape: &[usize], values: Vec<f32>) -> Result<TValue, PriorError> {
    let array = tract_ndarray::ArrayD::from_shape_vec(shape, values).map_err(failed)?;
    Ok(Tensor::from(array).into_tvalue())
}

/// Runs `plan` on as many threads as `executor` says.
fn run(plan: &Plan, inputs: TVec<TValue>, executor: Executor) -> Result<Vec<f32>, PriorError> {
    let outputs = multithread_tract_scope(executor, || plan.run(inputs)).map_err(failed)?;
    let view = outputs[0].to_plain_array_view::<f32>().map_err(failed)?;
    Ok(view.iter().copied().collect())
}
