//! The page in few pixels: mean colours of blocks, and how much they change.

use image::RgbaImage;
use rayon::prelude::*;
use subject::raster::Raster;

/// Mean colours of blocks of `factor` pixels a side, on `paper` where the page
/// is transparent.
pub(crate) fn colours(page: &RgbaImage, factor: usize, paper: [u8; 3]) -> Raster<[u8; 3]> {
    let (w, h) = (page.width() as usize, page.height() as usize);
    let (rw, rh) = (w.div_ceil(factor), h.div_ceil(factor));
    let mut small = Raster::filled(rw, rh, [0_u8; 3]);
    small.data.par_chunks_mut(rw.max(1)).enumerate().for_each(|(y, row)| {
        let mut sums = vec![[0_u32; 4]; rw];
        for v in y * factor..((y + 1) * factor).min(h) {
            let pixels = page.as_raw()[v * w * 4..(v + 1) * w * 4].chunks_exact(4);
            for (u, p) in pixels.enumerate() {
                let sum = &mut sums[u / factor];
                let alpha = u32::from(p[3]);
                for c in 0..3 {
                    let over = u32::from(p[c]) * alpha + u32::from(paper[c]) * (255 - alpha);
                    sum[c] += over / 255;
                }
                sum[3] += 1;
            }
        }
        for (colour, sum) in row.iter_mut().zip(&sums) {
            *colour = [0, 1, 2].map(|c| (sum[c] / sum[3].max(1)) as u8);
        }
    });
    small
}

/// How much the brightness changes at each pixel, 0 to 255.
pub(crate) fn detail(colours: &Raster<[u8; 3]>) -> Raster<u8> {
    let (w, h) = (colours.width, colours.height);
    let luma = |x: usize, y: usize| {
        let c = colours.data[y * w + x];
        (i32::from(c[0]) * 77 + i32::from(c[1]) * 150 + i32::from(c[2]) * 29) >> 8
    };
    let mut detail = Raster::filled(w, h, 0_u8);
    for y in 1..h.saturating_sub(1) {
        for x in 1..w.saturating_sub(1) {
            let across = (luma(x + 1, y) - luma(x - 1, y)).abs();
            let down = (luma(x, y + 1) - luma(x, y - 1)).abs();
            detail.data[y * w + x] = across.max(down).min(255) as u8;
        }
    }
    detail
}
