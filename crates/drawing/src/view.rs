//! Draws one view: its lines, its picture and its ground truth.

use std::io::Cursor;

use image::DynamicImage;
use image::codecs::jpeg::JpegEncoder;

use super::bvh::TriangleTree;
use super::camera::Camera;
use super::chain::{Piece, Stroke, chain};
use super::closing::close_outline;
use super::degrade::{Degradation, ViewError, view_random};
use super::features::{Node, Segment, ViewedModel};
use super::ink::ink_coverage;
use super::options::Ink;
use super::paint::{composed, multiplied};
use super::rules::LineRules;
use super::truth::{GroundTruth, SampledView};
use super::visibility::Visibility;
use super::{Background, DrawError, DrawOptions, PreparedModel, SheetLimits};
use frames::Viewpoint;

/// One view of a model, with what is true of it.
#[derive(Clone, Debug)]
pub struct DrawnView {
    /// Where the sheet states the view to be drawn from.
    pub viewpoint: Viewpoint,
    /// The camera of the ground truth: the view as the sheet states it.
    pub camera: Camera,
    /// The drawing, of as few channels as it needs: grey, grey with alpha, RGB or RGBA; sRGB.
    pub image: DynamicImage,
    /// The drawing's lines as vectors, px.
    pub strokes: Vec<Stroke>,
    /// Of the exact view, also where the drawing is degraded.
    pub truth: GroundTruth,
    /// How the drawing differs from the exact view as a whole, if it is degraded.
    pub error: Option<ViewError>,
}

/// Draws views of one model.
pub struct Drawer<'a> {
    model: &'a PreparedModel,
    options: DrawOptions,
    rules: LineRules,
    tree: TriangleTree,
    degradation: Option<Degradation>,
}

impl<'a> Drawer<'a> {
    /// # Errors
    /// [`DrawError`] if an option is out of range or the camera would be inside the model.
    pub fn new(model: &'a PreparedModel, options: &DrawOptions) -> Result<Self, DrawError> {
        options.check(SheetLimits::default().max_view_samples)?;
        check_camera(model.radius, options)?;
        Ok(Self {
            model,
            tree: model.triangle_tree(),
            rules: LineRules::new(model, options.crease_angle_deg, options.contours),
            degradation: options.degrade.resolved(options.line_width_px),
            options: options.clone(),
        })
    }

    /// What is true of the view from `viewpoint`, without its drawing.
    ///
    /// # Errors
    /// [`DrawError::TooComplex`] if the model's triangles cover each other too often.
    pub fn truth_of_view(&self, viewpoint: Viewpoint) -> Result<GroundTruth, DrawError> {
        let camera = Camera::new(viewpoint, &self.options);
        Ok(SampledView::new(self.model, &camera, &self.options)?.truth())
    }

    /// Draws the view from `viewpoint`.
    ///
    /// # Errors
    /// [`DrawError::TooComplex`] if the model's triangles hide each other too often.
    pub fn draw_view(&self, viewpoint: Viewpoint) -> Result<DrawnView, DrawError> {
        let camera = Camera::new(viewpoint, &self.options);
        let sampled = SampledView::new(self.model, &camera, &self.options)?;
        let truth = sampled.truth();
        let mut random = view_random(self.options.degrade.seed, viewpoint);
        let error = self.degradation.as_ref().map(|d| d.view_error(&mut random));
        let drawn_from = match &error {
            None => camera,
            Some(error) => self.misplaced(viewpoint, error),
        };
        let paint = match self.options.ink {
            Ink::Lines => None,
            ink if error.is_none() => Some(sampled.painted(ink)),
            ink => Some(SampledView::new(self.model, &drawn_from, &self.options)?.painted(ink)),
        };
        drop(sampled);
        let mut strokes = self.strokes(&drawn_from)?;
        if let Some(degradation) = &self.degradation {
            strokes = degradation.redraw(&strokes, &mut random);
        }
        let mut ink = ink_coverage(
            &strokes,
            self.options.width_px,
            self.options.height_px,
            self.options.supersampling,
            self.options.line_width_px,
        );
        let image = match &self.degradation {
            None => {
                close_outline(&mut ink, &truth.mask);
                composed(&ink, paint.as_ref(), self.options.background)
            }
            Some(degradation) => {
                let pencil = degradation.on_paper(&ink, &mut random);
                ink.fill(0);
                let paper = match self.options.background {
                    Background::Transparent => Background::White,
                    paper => paper,
                };
                let painted = composed(&ink, paint.as_ref(), paper);
                compressed(multiplied(painted, &pencil), degradation.jpeg_quality)?
            }
        };
        Ok(DrawnView { viewpoint, camera, image, strokes, truth, error })
    }

    fn misplaced(&self, viewpoint: Viewpoint, error: &ViewError) -> Camera {
        let ahead_rad = error.azimuth_error_deg.to_radians();
        let pixels_per_unit = self.options.pixels_per_unit() * error.scale;
        Camera::turned(viewpoint, ahead_rad, &self.options, pixels_per_unit).shifted(error.shift_px)
    }

    /// The visible lines, joined into strokes.
    fn strokes(&self, camera: &Camera) -> Result<Vec<Stroke>, DrawError> {
        let viewed = ViewedModel::new(self.model, camera);
        let visibility = Visibility::new(&viewed, &self.tree);
        let mut pieces = Vec::new();
        for segment in viewed.segments(camera, &self.rules) {
            visibility.check_work()?;
            let visible = visibility.visible_parts(&segment);
            for (part, kind) in visible.into_iter().flat_map(|v| visibility.resolved(&segment, v)) {
                let ends = piece_ends(&segment, part, pieces.len() as u32);
                pieces.push(Piece { kind, ends });
            }
        }
        Ok(chain(&pieces))
    }
}

/// The ends of a visible part: nodes of the mesh where it reaches the segment's ends.
fn piece_ends(
    segment: &Segment,
    [from, to]: [f64; 2],
    index: u32,
) -> [(Node, nalgebra::Point2<f64>); 2] {
    let [(first, p), (last, q)] = segment.ends;
    let at = |t: f64| (p + (q - p) * t).xy();
    let emergence = |end: u32| Node::Emergence(2 * index + end);
    [
        (if from == 0.0 { first } else { emergence(0) }, at(from)),
        (if to == 1.0 { last } else { emergence(1) }, at(to)),
    ]
}

/// * `radius`: the largest distance of the model from the origin, units.
pub(super) fn check_camera(radius: f64, options: &DrawOptions) -> Result<(), DrawError> {
    let distance = options.camera_distance();
    if radius >= distance {
        return Err(DrawError::CameraInsideModel { radius, distance });
    }
    Ok(())
}

/// The drawing after a JPEG compression; quality 0 is none.
fn compressed(drawing: DynamicImage, quality: u8) -> Result<DynamicImage, DrawError> {
    if quality == 0 {
        return Ok(drawing);
    }
    let failed = |error: image::ImageError| DrawError::Encoding {
        name: "the compressed drawing".to_owned(),
        reason: error.to_string(),
    };
    let mut bytes = Cursor::new(Vec::new());
    JpegEncoder::new_with_quality(&mut bytes, quality).encode_image(&drawing).map_err(failed)?;
    let decoded = image::load_from_memory_with_format(bytes.get_ref(), image::ImageFormat::Jpeg);
    decoded.map_err(failed)
}
