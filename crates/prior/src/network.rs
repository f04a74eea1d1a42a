//! The two networks, layer by layer as in `training/model.py`.

use progress::Observer;

use super::PriorError;
use super::convolution::{Convolution, Ending, Upsampling};
use super::sampling::Sampled;
use super::tensor::Tensor;
use super::weights::Weights;

/// Features a view and voxel.
pub(crate) const FEATURES: usize = 24;

const WEIGHTS: &[u8] = include_bytes!("../weights/prior.safetensors");

const RELU: Ending<'static> = Ending { skip: None, relu: true };
const LINEAR: Ending<'static> = Ending { skip: None, relu: false };

/// Drawings to features, a two-dimensional U-Net.
pub(crate) struct Encoder {
    stem: [Convolution; 3],
    residual: Residual,
    net: UNet,
}

/// Features of all views to logits, a three-dimensional U-Net.
pub(crate) struct Volume {
    /// Of each view on its own.
    pub fusion: Fusion,
    residual: Residual,
    net: UNet,
}

/// How the features of views become one.
pub(crate) struct Fusion {
    /// By feature, then by what is known of the place.
    pub position: Vec<f32>,
    pub mix: Convolution,
    /// By feature, and the bias.
    pub score: (Vec<f32>, f32),
    /// Reads the mean, the maximum and what is told besides.
    pub joined: Convolution,
}

/// Two convolutions beside a shortcut.
struct Residual {
    first: Convolution,
    second: Convolution,
}

/// Three times halved, then doubled again, with a shortcut at each size.
struct UNet {
    down: Vec<(Convolution, Vec<Residual>)>,
    up: Vec<(Upsampling, Residual)>,
    out: Convolution,
}

/// Reads both networks.
pub(crate) fn load() -> Result<(Encoder, Volume), PriorError> {
    let weights = Weights::read(WEIGHTS)?;
    let layer = |name: &str, stride| weights.convolution(name, stride);
    let encoder = Encoder {
        stem: [
            layer("encoder.stem.0", 2)?,
            layer("encoder.stem.1", 1)?,
            layer("encoder.stem.2", 2)?,
        ],
        residual: Residual::read(&weights, "encoder.stem.3")?,
        net: UNet::read(&weights, "encoder", [1, 2, 2])?,
    };
    let score = weights.weights("volume.score")?.1;
    let fusion = Fusion {
        position: weights.weights("volume.pos")?.1,
        mix: layer("volume.mix", 1)?,
        score: (score, weights.bias("volume.score", 1)?[0]),
        joined: layer("volume.inp", 1)?,
    };
    let volume = Volume {
        fusion,
        residual: Residual::read(&weights, "volume.e0")?,
        net: UNet::read(&weights, "volume", [1, 1, 1])?,
    };
    Ok((encoder, volume))
}

impl Encoder {
    /// Features by row and column of voxels.
    pub(crate) fn features(
        &self,
        image: &Sampled,
        observer: &dyn Observer,
    ) -> Result<Tensor, PriorError> {
        let mut values = image.as_tensor();
        for layer in &self.stem {
            values = layer.run(&values, RELU);
        }
        self.net.run(self.residual.run(&values), observer)
    }
}

impl Volume {
    /// Eight logits a voxel, of `joined` features.
    pub(crate) fn logits(
        &self,
        joined: &Tensor,
        observer: &dyn Observer,
    ) -> Result<Tensor, PriorError> {
        self.net.run(self.residual.run(joined), observer)
    }
}

impl Residual {
    fn read(weights: &Weights<'_>, name: &str) -> Result<Self, PriorError> {
        let layer = |part: &str| weights.convolution(&format!("{name}.{part}"), 1);
        Ok(Self { first: layer("a")?, second: layer("b")? })
    }

    fn run(&self, input: &Tensor) -> Tensor {
        let inner = self.first.run(input, RELU);
        self.second.run(&inner, Ending { skip: Some(input), relu: true })
    }
}

impl UNet {
    /// * `residuals`: how many there are at each smaller size.
    fn read(weights: &Weights<'_>, name: &str, residuals: [usize; 3]) -> Result<Self, PriorError> {
        let down = residuals.iter().enumerate().map(|(level, &count)| {
            let halved = weights.convolution(&format!("{name}.down.{level}.0"), 2)?;
            let residual = |part| Residual::read(weights, &format!("{name}.down.{level}.{part}"));
            Ok((halved, (1..=count).map(residual).collect::<Result<_, _>>()?))
        });
        let up = (0..residuals.len()).map(|level| {
            let doubled = weights.upsampling(&format!("{name}.up.{level}.c"))?;
            Ok((doubled, Residual::read(weights, &format!("{name}.res.{level}"))?))
        });
        Ok(Self {
            down: down.collect::<Result<_, PriorError>>()?,
            up: up.collect::<Result<_, PriorError>>()?,
            out: weights.convolution(&format!("{name}.out"), 1)?,
        })
    }

    fn run(&self, input: Tensor, observer: &dyn Observer) -> Result<Tensor, PriorError> {
        let mut sizes = Vec::with_capacity(self.down.len());
        let mut values = input;
        for (halved, residuals) in &self.down {
            observer.check()?;
            let smaller = halved.run(&values, RELU);
            sizes.push(std::mem::replace(&mut values, smaller));
            for residual in residuals {
                values = residual.run(&values);
            }
        }
        for (doubled, residual) in &self.up {
            observer.check()?;
            let skip = sizes.pop();
            values = doubled.run(&values, Ending { skip: skip.as_ref(), relu: true });
            drop(skip);
            values = residual.run(&values);
        }
        observer.check()?;
        Ok(self.out.run(&values, LINEAR))
    }
}
