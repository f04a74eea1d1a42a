//! Pictures to judge by: of depth maps drawing, truth, ours and error side by side; of solids
//! drawing, truth and ours.

use image::{DynamicImage, GrayImage, ImageResult, Luma, Rgb, RgbImage, imageops};

use picture::FloatImage;

/// Width of one picture, px.
const TILE_PX: u32 = 480;
/// This much too near or too far, px of disparity, is shown in full colour.
const FULL_ERROR_PX: f32 = 4.0;

/// One sheet's pictures; maps are disparity of the 5-degree pair, px.
#[derive(Clone)]
pub(super) struct Row {
    pub sheet: String,
    pub drawing: GrayImage,
    pub truth: FloatImage,
    pub ours: FloatImage,
}

/// All rows, one below the other, by name of the sheet; `None` if there is none.
pub(super) fn sheet(rows: &[Row]) -> Option<RgbImage> {
    let mut rows: Vec<_> = rows.iter().collect();
    rows.sort_by(|a, b| a.sheet.cmp(&b.sheet));
    rows.dedup_by(|a, b| a.sheet == b.sheet);
    let tiles: Vec<_> = rows.into_iter().map(Row::tiles).collect();
    let height = tiles.iter().map(|tiles| tiles[0].height()).sum();
    if height == 0 {
        return None;
    }
    let mut picture = RgbImage::new(4 * TILE_PX, height);
    let mut y = 0;
    for tiles in tiles {
        for (x, tile) in (0..).step_by(TILE_PX as usize).zip(&tiles) {
            imageops::replace(&mut picture, tile, x, y);
        }
        y += i64::from(tiles[0].height());
    }
    Some(picture)
}

impl Row {
    fn tiles(&self) -> [RgbImage; 4] {
        let finite = || self.truth.iter().copied().filter(|value| value.is_finite());
        let low = finite().fold(f32::INFINITY, f32::min);
        let high = finite().fold(f32::NEG_INFINITY, f32::max);
        let nearness = |map: &FloatImage| {
            picture(map, |value| {
                let grey = 55.0 + 200.0 * (value - low) / (high - low).max(f32::MIN_POSITIVE);
                [grey.clamp(0.0, 255.0) as u8; 3]
            })
        };
        let mut error = self.ours.clone();
        error.iter_mut().zip(self.truth.iter()).for_each(|(ours, truth)| *ours -= truth);
        // Too near is red, too far blue.
        let error = picture(&error, |error| {
            let pale = 255 - (255.0 * (error.abs() / FULL_ERROR_PX).min(1.0)) as u8;
            if error > 0.0 { [255, pale, pale] } else { [pale, pale, 255] }
        });
        let drawing = DynamicImage::from(self.drawing.clone()).to_rgb8();
        [drawing, nearness(&self.truth), nearness(&self.ours), error].map(shrunk)
    }
}

/// One subject's solids, as [`mesh::thumbnail`]s.
#[derive(Clone)]
pub(super) struct SolidRow {
    /// Of the first view.
    pub drawing: GrayImage,
    pub truth: Vec<u8>,
    pub ours: Vec<u8>,
}

/// Drawing, truth and draft of each subject, one below the other in their order; `None` if there
/// is none.
pub(super) fn solids(rows: &[SolidRow]) -> ImageResult<Option<RgbImage>> {
    const SIDE: u32 = 256;
    if rows.is_empty() {
        return Ok(None);
    }
    let paper = Rgb([255; 3]);
    let mut picture = RgbImage::from_pixel(7 * SIDE, SIDE * rows.len() as u32, paper);
    for (row, y) in rows.iter().zip((0..).step_by(SIDE as usize)) {
        let drawing = DynamicImage::from(row.drawing.clone());
        let drawing = drawing.resize(SIDE, SIDE, imageops::FilterType::Triangle).into_rgb8();
        let middle = i64::from(SIDE - drawing.height()) / 2;
        imageops::replace(&mut picture, &drawing, 0, y + middle);
        for (solid, x) in [(&row.truth, SIDE), (&row.ours, 4 * SIDE)] {
            let solid = image::load_from_memory(solid)?.into_rgb8();
            imageops::replace(&mut picture, &solid, i64::from(x), y);
        }
    }
    Ok(Some(picture))
}

/// Black where there is no value.
fn picture(map: &FloatImage, colour: impl Fn(f32) -> [u8; 3]) -> RgbImage {
    RgbImage::from_fn(map.width(), map.height(), |x, y| {
        let Luma([value]) = *map.get_pixel(x, y);
        Rgb(if value.is_finite() { colour(value) } else { [0; 3] })
    })
}

fn shrunk(picture: RgbImage) -> RgbImage {
    let height = (picture.height() * TILE_PX).div_ceil(picture.width().max(1));
    imageops::resize(&picture, TILE_PX, height.max(1), imageops::FilterType::Triangle)
}
