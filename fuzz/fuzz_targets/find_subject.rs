//! A picture file of any kind, decoded and searched for its subject.
#![no_main]

use libfuzzer_sys::fuzz_target;
use picture::{ImageLimits, decode_color};
use subject::{Hints, SubjectOptions, find};

const LIMITS: ImageLimits = ImageLimits { max_bytes: 1 << 20, max_pixels: 1 << 18, max_side_px: 2048 };

fuzz_target!(|data: &[u8]| {
    let Ok(drawing) = decode_color(data, &LIMITS) else {
        return;
    };
    if let Ok(found) = find(&drawing, &Hints::default(), &SubjectOptions::default(), &|| false) {
        assert_eq!(found.mask.dimensions(), drawing.dimensions());
        assert!(found.area_px() > 0);
    }
});
