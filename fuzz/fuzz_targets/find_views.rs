//! A picture file of any kind, decoded as a page and searched for views.
#![no_main]

use libfuzzer_sys::fuzz_target;
use page::{PageOptions, cut_out, decode, preview, propose_all};
use picture::ImageLimits;
use progress::Silent;

const LIMITS: ImageLimits = ImageLimits { max_bytes: 1 << 20, max_pixels: 1 << 18, max_side_px: 2048 };

fuzz_target!(|data: &[u8]| {
    let options = PageOptions { working_side_px: 256, ..PageOptions::default() };
    let Ok(pictures) = decode(data, &LIMITS, 12) else {
        return;
    };
    let Ok(proposals) = propose_all(&pictures, &options, &Silent) else {
        return;
    };
    for (picture, proposal) in pictures.iter().zip(&proposals) {
        preview(picture, proposal);
        for (index, figure) in proposal.figures.iter().enumerate() {
            assert_eq!(figure.mask.dimensions(), (figure.place.width(), figure.place.height()));
            cut_out(picture, proposal, index);
        }
    }
});
