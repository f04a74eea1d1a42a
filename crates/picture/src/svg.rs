//! SVG drawings as pixels, without scripts, text, other files or unbounded work.
//!
//! What is untrusted here is a program for a renderer: a few hundred bytes can ask for hours.
//! Size, elements, styles and the pixels that all shapes cover are bounded before anything is
//! drawn; what multiplies shapes (markers, patterns, filters) is refused by name.

use image::RgbaImage;
use resvg::tiny_skia::{Pixmap, Transform};
use resvg::usvg::roxmltree::{Document, ParsingOptions};
use resvg::usvg::{Group, ImageHrefResolver, Node, Options, Path, Rect, Tree};

use super::decode::{ImageError, ImageLimits};

/// Larger files are no drawings of lines.
const MAX_BYTES: usize = 4 << 20;
/// Nodes of the document, attributes not counted.
const MAX_NODES: u32 = 200_000;
/// Bytes of style sheets times elements: each rule is tried on each element.
const MAX_STYLING: u64 = 1 << 31;
/// Pixels that shapes and layers may cover in all, and rows that their edges may cross.
const MAX_VISITED: f64 = (1_u64 << 31) as f64;
/// A drawing of fewer pixels a side is drawn larger.
const LEAST_SIDE: f32 = 512.0;
/// Elements that multiply work, or hold what is not read.
const REFUSED: [&str; 4] = ["filter", "pattern", "marker", "image"];

/// A parsed drawing, and the size at which it is drawn.
pub(crate) struct Svg {
    tree: Tree,
    pub(crate) width: u32,
    pub(crate) height: u32,
    scale: f32,
}

/// Whether bytes begin as an SVG does.
pub(crate) fn is_svg(bytes: &[u8]) -> bool {
    let text = bytes.get(..1024).unwrap_or(bytes);
    let is_text = text.trim_ascii_start().starts_with(b"<") || text.starts_with(b"\xef\xbb\xbf<");
    is_text && text.windows(4).any(|window| window == b"<svg")
}

impl Svg {
    /// Parses a drawing; its own size in pixels is used, a small one's is multiplied.
    ///
    /// # Errors
    /// [`ImageError`] for what is damaged, too large, too much work, or refused by name.
    pub(crate) fn parse(bytes: &[u8], limits: &ImageLimits) -> Result<Self, ImageError> {
        if bytes.len() > MAX_BYTES {
            let (bytes, limit) = (bytes.len() as u64, MAX_BYTES as u64);
            return Err(ImageError::TooManyBytes { bytes, limit });
        }
        let damaged = |error: &dyn std::fmt::Display| ImageError::Damaged(error.to_string());
        let text = std::str::from_utf8(bytes).map_err(|error| damaged(&error))?;
        let parsing =
            ParsingOptions { allow_dtd: true, nodes_limit: MAX_NODES, ..ParsingOptions::default() };
        let document = Document::parse_with_options(text, parsing).map_err(|e| damaged(&e))?;
        check_elements(&document)?;
        let options = Options {
            image_href_resolver: ImageHrefResolver {
                resolve_data: Box::new(|_, _, _| None),
                resolve_string: Box::new(|_, _| None),
            },
            ..Options::default()
        };
        let tree = Tree::from_xmltree(&document, &options).map_err(|e| damaged(&e))?;
        let (own_width, own_height) = (tree.size().width(), tree.size().height());
        let scale = (LEAST_SIDE / own_width.max(own_height)).ceil().clamp(1.0, LEAST_SIDE);
        // Casts saturate.
        let [width, height] =
            [own_width, own_height].map(|side| (side * scale).round().max(1.0) as u32);
        limits.expect(width, height)?;
        let found = Self { tree, width, height, scale };
        let canvas = [width as f32, height as f32];
        if visited(found.tree.root(), scale, canvas) > MAX_VISITED {
            return Err(refused("an SVG drawing of too many or too large shapes"));
        }
        Ok(found)
    }

    /// Draws it on nothing.
    pub(crate) fn rendered(&self) -> Result<RgbaImage, ImageError> {
        let mut pixels = Pixmap::new(self.width, self.height)
            .ok_or_else(|| ImageError::Damaged("it has no pixels".to_owned()))?;
        let transform = Transform::from_scale(self.scale, self.scale);
        resvg::render(&self.tree, transform, &mut pixels.as_mut());
        let straight = pixels.pixels().iter().flat_map(|pixel| {
            let pixel = pixel.demultiply();
            [pixel.red(), pixel.green(), pixel.blue(), pixel.alpha()]
        });
        let image = RgbaImage::from_raw(self.width, self.height, straight.collect());
        image.ok_or_else(|| ImageError::Damaged("it has no pixels".to_owned()))
    }
}

fn refused(kind: &'static str) -> ImageError {
    ImageError::Unsupported { kind, remedy: "export it as PNG" }
}

fn check_elements(document: &Document<'_>) -> Result<(), ImageError> {
    let elements = || document.descendants().filter(|node| node.is_element());
    let has = |name: &str| elements().any(|node| node.tag_name().name() == name);
    if let Some(name) = REFUSED.into_iter().find(|name| has(name)) {
        return Err(refused(match name {
            "filter" => "an SVG drawing with filters",
            "pattern" => "an SVG drawing with patterns",
            "marker" => "an SVG drawing with markers",
            _ => "an SVG drawing with pictures in it",
        }));
    }
    let styles = elements().filter(|node| node.tag_name().name() == "style");
    let bytes: usize = styles.map(|node| node.text().map_or(0, str::len)).sum();
    let count = elements().count() as u64;
    if bytes as u64 * count > MAX_STYLING {
        return Err(refused("an SVG drawing with too many styles"));
    }
    Ok(())
}

/// About how many pixels are visited for a group: those of its shapes and of layers of its own.
fn visited(group: &Group, scale: f32, canvas: [f32; 2]) -> f64 {
    let layers = f64::from(u8::from(group.should_isolate()))
        + 2.0 * f64::from(u8::from(group.mask().is_some()))
        + 2.0 * f64::from(u8::from(group.clip_path().is_some()));
    let mut sum = layers * area(canvas);
    for node in group.children() {
        sum += match node {
            Node::Group(group) => visited(group, scale, canvas),
            Node::Path(path) => of_path(path, scale, canvas),
            _ => 0.0,
        };
        if sum > MAX_VISITED {
            break;
        }
    }
    // What masks and clip paths are made of.
    let mask = group.mask().map(|mask| visited(mask.root(), scale, canvas));
    let clip = group.clip_path().map(|clip| visited(clip.root(), scale, canvas));
    sum + mask.unwrap_or(0.0) + clip.unwrap_or(0.0)
}

fn area([width, height]: [f32; 2]) -> f64 {
    f64::from(width) * f64::from(height)
}

fn of_path(path: &Path, scale: f32, canvas: [f32; 2]) -> f64 {
    let size = shown(&path.abs_stroke_bounding_box(), scale, canvas);
    let edges = path.data().len() as f64;
    let dashes = path.stroke().and_then(|stroke| {
        let period: f32 = stroke.dasharray()?.iter().sum();
        let around = path.bounding_box();
        // A path is no longer than so many times its box's sides.
        let length = edges * f64::from(around.width() + around.height());
        Some((length / f64::from(period.max(f32::MIN_POSITIVE))).min(1e6))
    });
    area(size) + (edges + 8.0 * dashes.unwrap_or(0.0)) * f64::from(size[1] + 8.0)
}

/// Width and height of the part of a box that is on the canvas.
fn shown(bounds: &Rect, scale: f32, [width, height]: [f32; 2]) -> [f32; 2] {
    let span = |low: f32, high: f32, side: f32| {
        ((high * scale).min(side) - (low * scale).max(0.0)).max(0.0)
    };
    [span(bounds.left(), bounds.right(), width), span(bounds.top(), bounds.bottom(), height)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{decode_color, inspect};

    fn svg(size: &str, body: &str) -> Vec<u8> {
        format!("<svg xmlns=\"http://www.w3.org/2000/svg\" {size}>{body}</svg>").into_bytes()
    }

    const SIZE: &str = "width=\"600\" height=\"400\"";

    fn kind(bytes: &[u8]) -> String {
        decode_color(bytes, &ImageLimits::default()).unwrap_err().to_string()
    }

    #[test]
    fn shapes_are_drawn_where_they_are() {
        let body = "<rect x=\"100\" y=\"50\" width=\"200\" height=\"100\" fill=\"#102030\"/>";
        let found = decode_color(&svg(SIZE, body), &ImageLimits::default()).unwrap();
        assert_eq!(found.dimensions(), (600, 400));
        assert_eq!(found.get_pixel(150, 100).0, [16, 32, 48, 255]);
        assert_eq!(found.get_pixel(20, 20).0, [0; 4]);
    }

    #[test]
    fn small_drawings_are_drawn_larger_and_large_ones_refused() {
        let size = "viewBox=\"0 0 64 32\"";
        let limits = ImageLimits::default();
        let (_, width, height) = inspect(&svg(size, "<path d=\"M0 0h9v9z\"/>"), &limits).unwrap();
        assert_eq!((width, height), (512, 256));
        let size = "width=\"100000\" height=\"100000\"";
        assert!(kind(&svg(size, "")).contains("over the limit"));
        assert!(decode_color(&svg("width=\"0\" height=\"0\"", ""), &limits).is_err());
    }

    #[test]
    fn nothing_outside_of_the_file_is_read_or_run() {
        let image = "<image href=\"/etc/passwd\" width=\"9\" height=\"9\"/>";
        assert!(kind(&svg(SIZE, image)).contains("pictures in it"));
        let script = "<script>while(true){}</script><text x=\"9\" y=\"99\">A</text>\
                      <use href=\"file:///etc/passwd#x\"/><rect width=\"9\" height=\"9\"/>";
        let found = decode_color(&svg(SIZE, script), &ImageLimits::default()).unwrap();
        assert_eq!(found.get_pixel(4, 4).0, [0, 0, 0, 255]);
        let entity = "<?xml version=\"1.0\"?><!DOCTYPE svg [<!ENTITY x SYSTEM \
                      \"file:///etc/passwd\">]><svg xmlns=\"http://www.w3.org/2000/svg\">&x;</svg>";
        assert!(decode_color(entity.as_bytes(), &ImageLimits::default()).is_err());
    }

    #[test]
    fn bombs_are_refused_before_they_go_off() {
        let mut uses = "<g id=\"a0\"><rect width=\"600\" height=\"400\"/></g>".to_owned();
        for level in 1..=9 {
            let inner = format!("<use href=\"#a{}\"/>", level - 1).repeat(10);
            uses += &format!("<g id=\"a{level}\">{inner}</g>");
        }
        assert!(decode_color(&svg(SIZE, &uses), &ImageLimits::default()).is_err());
        let large = "<rect width=\"6000\" height=\"6000\"/>".repeat(20_000);
        assert!(kind(&svg("width=\"6000\" height=\"6000\"", &large)).contains("too many or too"));
        let deep = "<g>".repeat(100_000);
        assert!(decode_color(&svg(SIZE, &deep), &ImageLimits::default()).is_err());
        let deep = format!("{}{}", "<g>".repeat(5000), "</g>".repeat(5000));
        assert!(decode_color(&svg(SIZE, &deep), &ImageLimits::default()).is_err());
        let layers = "<g opacity=\"0.5\"><rect width=\"6000\" height=\"6000\"/></g>".repeat(2000);
        assert!(
            decode_color(&svg("width=\"6000\" height=\"6000\"", &layers), &Default::default())
                .is_err()
        );
        for refused in ["filter", "pattern", "marker"] {
            assert!(kind(&svg(SIZE, &format!("<{refused} id=\"x\"/>"))).contains(refused));
        }
        let style = format!("<style>{}</style>", ".a{fill:red}".repeat(50_000));
        let many = "<g/>".repeat(10_000);
        assert!(kind(&svg(SIZE, &format!("{style}{many}"))).contains("styles"));
        let entities = "<!DOCTYPE svg [<!ENTITY a \"aaaaaaaaaa\"><!ENTITY b \"&a;&a;&a;&a;&a;&a;\">\
                        <!ENTITY c \"&b;&b;&b;&b;&b;&b;\"><!ENTITY d \"&c;&c;&c;&c;&c;&c;\">\
                        <!ENTITY e \"&d;&d;&d;&d;&d;&d;\"><!ENTITY f \"&e;&e;&e;&e;&e;&e;\">]>\
                        <svg xmlns=\"http://www.w3.org/2000/svg\" width=\"9\" height=\"9\">&f;</svg>";
        // Six times six times: refused or read, but not for long.
        let _ = decode_color(entities.as_bytes(), &ImageLimits::default());
    }

    #[test]
    fn text_that_is_no_svg_is_damaged_or_no_picture() {
        assert!(matches!(
            decode_color(b"<svg", &ImageLimits::default()),
            Err(ImageError::Damaged(_))
        ));
        assert!(!is_svg(b"a letter about <svg"));
        assert!(is_svg(b"\xef\xbb\xbf<?xml version='1.0'?>\n<svg"));
    }
}
