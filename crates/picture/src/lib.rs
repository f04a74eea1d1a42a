//! Pictures and float maps as bytes.
//!
//! What comes in is untrusted: [`inspect`] reads the header and holds it
//! against [`ImageLimits`], [`decode`] takes no more memory than the header
//! promised. What goes out is made by one PNG encoder and one PFM encoder, so
//! that the same map is the same file wherever it is served.

mod decode;
mod float_image;
mod flood;
mod inflation;
mod kinds;
mod maps;
mod pfm;
mod png;
mod svg;

pub use decode::{
    Drawing, Format, ImageError, ImageLimits, decode, decode_color, flatten, inspect,
};
pub use float_image::{FloatImage, ValueRange};
pub use flood::{border, flooded};
pub use inflation::expect_bounded_exr;
pub use kinds::tiff_pages_apart;
pub use maps::{DepthEncoding, depth_png, disparity_png, normals_png, silhouette_png};
pub use pfm::{PfmError, decode_pfm, encode_pfm};
pub use png::{EncodeError, dynamic_png, png};
