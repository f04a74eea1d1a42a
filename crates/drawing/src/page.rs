//! The page that shows all views of a sheet with their angles.

use image::{DynamicImage, ImageBuffer, Luma, Pixel, Rgb, imageops};
use nalgebra::Point2;

use super::ink::ink_coverage;
use super::lettering::lettering;
use super::paint::mixed;
use super::{DrawOptions, Stroke};
use frames::Viewpoint;

/// A view as it goes on the page.
pub(super) struct PageView {
    pub viewpoint: Viewpoint,
    /// Grey or RGB.
    pub image: DynamicImage,
    /// First and last column and row that hold ink; `None` for an empty view.
    pub ink: Option<InkBounds>,
}

#[derive(Clone, Copy, Debug)]
pub(super) struct InkBounds {
    low: [f64; 2],
    high: [f64; 2],
}

impl InkBounds {
    pub(crate) fn of(strokes: &[Stroke]) -> Option<Self> {
        let points = strokes.iter().flat_map(|stroke| &stroke.points);
        points.fold(None, |bounds: Option<Self>, p| {
            let (low, high) = bounds.map_or(([p.x, p.y], [p.x, p.y]), |b| (b.low, b.high));
            Some(Self {
                low: [low[0].min(p.x), low[1].min(p.y)],
                high: [high[0].max(p.x), high[1].max(p.y)],
            })
        })
    }
}

/// A view to be put on a page.
pub struct PageDrawing {
    /// Where it is drawn from.
    pub viewpoint: Viewpoint,
    /// Grey or RGB; all of one size.
    pub image: DynamicImage,
    /// First and one past the last column and row of the subject, px; `None` for an empty view.
    pub bounds: Option<[[f64; 2]; 2]>,
}

/// Puts views side by side as pages of drawn sheets have them, on white: at one scale, on one
/// ground line, with their angles below. No views make an empty page.
pub fn page(views: &[PageDrawing]) -> DynamicImage {
    let Some(first) = views.first() else { return DynamicImage::new_luma8(1, 1) };
    let (width_px, height_px) = (first.image.width(), first.image.height());
    let options = DrawOptions { width_px, height_px, ..DrawOptions::default() };
    let view = |drawing: &PageDrawing| PageView {
        viewpoint: drawing.viewpoint,
        image: drawing.image.clone(),
        ink: drawing.bounds.map(|[columns, rows]| InkBounds {
            low: [columns[0], rows[0]],
            high: [columns[1], rows[1]],
        }),
    };
    let views: Vec<PageView> = views.iter().map(view).collect();
    compose_page(&views.iter().collect::<Vec<_>>(), &options)
}

const MAX_COLUMNS: usize = 8;

/// Puts the views side by side at the same scale and on the same ground, with their angles below;
/// more than eight go on several rows.
///
/// Grey if all views are. With labels and what stays empty of the last row, the page has at most four times the pixels
/// of the views.
pub(super) fn compose_page(views: &[&PageView], options: &DrawOptions) -> DynamicImage {
    // White behind views that have nothing behind them.
    let [r, g, b] = options.background.paper().unwrap_or([255; 3]);
    if views.iter().all(|view| view.image.color() == image::ColorType::L8) {
        compose(views, options, Luma([r]), DynamicImage::into_luma8).into()
    } else {
        compose(views, options, Rgb([r, g, b]), DynamicImage::into_rgb8).into()
    }
}

fn compose<P: Pixel<Subpixel = u8>>(
    views: &[&PageView],
    options: &DrawOptions,
    paper: P,
    converted: fn(DynamicImage) -> ImageBuffer<P, Vec<u8>>,
) -> ImageBuffer<P, Vec<u8>> {
    let window = Window::around(views, options);
    let letter_px = (f64::from(options.height_px) / 30.0).clamp(8.0, 48.0);
    let label_px = (2.5 * letter_px) as u32;
    let columns = views.len().clamp(1, MAX_COLUMNS) as u32;
    let rows = (views.len() as u32).div_ceil(columns);
    let (width, height) = (columns * window.width, rows * (window.height + label_px));
    let mut page = ImageBuffer::from_pixel(width, height, paper);
    let mut labels = Vec::new();
    for (index, view) in views.iter().enumerate() {
        let left = (index as u32 % columns) * window.width;
        let top = (index as u32 / columns) * (window.height + label_px);
        let crop = view.image.crop_imm(window.x, window.y, window.width, window.height);
        imageops::replace(&mut page, &converted(crop), left.into(), top.into());
        let below = Point2::new(
            f64::from(left) + f64::from(window.width) / 2.0,
            f64::from(top + window.height) + 0.5 * letter_px,
        );
        labels.extend(lettering(&label(view.viewpoint), below, letter_px));
    }
    let ink = ink_coverage(&labels, width, height, 1, options.line_width_px.max(1.5));
    let pen = options.background.contrasting();
    for (pixel, ink) in page.pixels_mut().zip(ink.pixels()) {
        pixel.apply(|level| mixed(level, pen, ink.0[0]));
    }
    page
}

/// `45°`, or with the elevation of a view that is not level `45° /30°`, from below `45° /-30°`.
fn label(view: Viewpoint) -> String {
    let azimuth = format!("{}°", view.azimuth);
    if view.is_level() { azimuth } else { format!("{azimuth} /{}°", view.elevation.degrees()) }
}

/// The part of the views that the page shows: the same in all, so that scale and ground agree.
struct Window {
    x: u32,
    y: u32,
    width: u32,
    height: u32,
}

impl Window {
    fn around(views: &[&PageView], options: &DrawOptions) -> Self {
        let margin = f64::from(options.height_px) / 40.0 + options.line_width_px;
        let bounds = views.iter().filter_map(|view| view.ink);
        let union = bounds.reduce(|a, b| InkBounds {
            low: [a.low[0].min(b.low[0]), a.low[1].min(b.low[1])],
            high: [a.high[0].max(b.high[0]), a.high[1].max(b.high[1])],
        });
        let size = [options.width_px, options.height_px];
        let Some(union) = union else {
            return Self { x: 0, y: 0, width: size[0], height: size[1] };
        };
        // The casts saturate; the axis stays in the middle.
        let half = f64::from(size[0]) / 2.0;
        let reach = (half - union.low[0]).max(union.high[0] - half) + margin;
        let x = ((half - reach).max(0.0) as u32).min(size[0] / 2 - 1);
        let y = ((union.low[1] - margin).max(0.0) as u32).min(size[1] - 1);
        let bottom = ((union.high[1] + margin).ceil().max(0.0) as u32).clamp(y + 1, size[1]);
        Self { x, y, width: size[0] - 2 * x, height: bottom - y }
    }
}
