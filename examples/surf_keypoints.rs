//! Prints the SURF keypoints of pictures, for `tools/surf_repeatability.py`:
//! per picture a line `# name`, then `x y size response` of each, strongest
//! first. Arguments: Hessian threshold, octaves, layers, pictures.

use std::error::Error;

use uncalibrated::vision::surf::{SurfOptions, detect};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [threshold, octaves, layers, pictures @ ..] = arguments.as_slice() else {
        return Err("usage: surf_keypoints THRESHOLD OCTAVES LAYERS PICTURE...".into());
    };
    let options = SurfOptions {
        hessian_threshold: threshold.parse()?,
        octaves: octaves.parse()?,
        octave_layers: layers.parse()?,
        upright: true,
    };
    for picture in pictures {
        println!("# {picture}");
        for found in detect(&image::open(picture)?.to_luma8(), &options) {
            println!("{} {} {} {}", found.x, found.y, found.size, found.response);
        }
    }
    Ok(())
}
