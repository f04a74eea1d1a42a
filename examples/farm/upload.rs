//! Small sheets, each seed's its own.

use std::io::Cursor;

use image::{GrayImage, ImageFormat, Luma};
use imageproc::drawing::{draw_filled_rect_mut, draw_hollow_ellipse_mut};
use imageproc::rect::Rect;
use reqwest::multipart::{Form, Part};

use crate::Result;

/// Three views, cheap to reconstruct, each time anew.
pub(crate) fn sheet(seed: u64) -> Result<Form> {
    Ok(plain_sheet(seed)?.text("reuse", "false"))
}

/// As [`sheet`], about a second's work for one core.
pub(crate) fn larger_sheet(seed: u64) -> Result<Form> {
    Ok(views(seed)?.text("turntable.solid.resolution", "96").text("reuse", "false"))
}

/// As [`sheet`], with nothing that an older version does not know.
pub(crate) fn plain_sheet(seed: u64) -> Result<Form> {
    Ok(views(seed)?.text("turntable.solid.resolution", "32"))
}

fn views(seed: u64) -> Result<Form> {
    let mut form = Form::new();
    for azimuth_deg in [0, 45, 90] {
        let png = drawing(seed, azimuth_deg)?;
        let part = Part::bytes(png).file_name("view.png").mime_str("image/png")?;
        form = form.part(format!("view[{azimuth_deg}]"), part);
    }
    Ok(form)
}

fn drawing(seed: u64, azimuth_deg: i32) -> Result<Vec<u8>> {
    let seed = i32::try_from(seed % 1000)?;
    let mut image = GrayImage::from_pixel(96, 72, Luma([255]));
    let (width, height) = (14 + (seed + azimuth_deg) % 17, 18 + seed % 13);
    for grown in 0..2 {
        draw_hollow_ellipse_mut(&mut image, (48, 36), width + grown, height + grown, Luma([0]));
    }
    draw_filled_rect_mut(&mut image, Rect::at(46, 30).of_size(4, 2), Luma([0]));
    let mut png = Cursor::new(Vec::new());
    image.write_to(&mut png, ImageFormat::Png)?;
    Ok(png.into_inner())
}
