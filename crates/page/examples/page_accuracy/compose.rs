//! Pages composed from drawn views, with what is true of them.

use image::imageops::{self, FilterType};
use image::{GrayImage, Rgb, RgbImage};
use rand::Rng;
use rand_chacha::ChaCha8Rng;

use crate::models::{Drawn, STEP_DEG, Subject};

/// A page and what is on it.
pub(crate) struct Page {
    pub(crate) picture: RgbImage,
    /// In reading order.
    pub(crate) truth: Vec<Placed>,
    /// What makes it difficult.
    pub(crate) traits: Vec<&'static str>,
}

/// A view as it was put on the page.
pub(crate) struct Placed {
    /// Left, top, right, bottom, px.
    pub(crate) bounds: [u32; 4],
    pub(crate) azimuth_deg: f64,
    pub(crate) tellable: bool,
    /// The same drawing by itself, on the page's paper.
    pub(crate) alone: RgbImage,
}

/// Orders of views by their number, in steps of [`STEP_DEG`].
const ORDERS: [&[&[usize]]; 7] = [
    &[&[0, 2], &[0, 4], &[0, 6]],
    &[&[0, 2, 4], &[0, 6, 4], &[0, 1, 2], &[0, 7, 6], &[2, 0, 6]],
    &[&[0, 2, 4, 6], &[0, 6, 4, 2], &[0, 1, 2, 4], &[0, 7, 6, 4]],
    &[&[0, 1, 2, 3, 4], &[0, 7, 6, 5, 4]],
    &[&[0, 1, 2, 3, 4, 6], &[0, 1, 2, 4, 6, 7]],
    &[&[0, 1, 2, 3, 4, 5, 6], &[0, 7, 6, 5, 4, 3, 2]],
    &[&[0, 1, 2, 3, 4, 5, 6, 7], &[0, 7, 6, 5, 4, 3, 2, 1]],
];

/// Letters as strokes on a grid 4 wide and 6 high.
const GLYPHS: [(char, &[[u8; 4]]); 14] = [
    ('f', &[[0, 0, 0, 6], [0, 0, 4, 0], [0, 3, 3, 3]]),
    ('r', &[[0, 0, 0, 6], [0, 0, 4, 1], [4, 1, 0, 3], [1, 3, 4, 6]]),
    ('o', &[[1, 0, 3, 0], [3, 0, 4, 3], [4, 3, 3, 6], [3, 6, 1, 6], [1, 6, 0, 3], [0, 3, 1, 0]]),
    ('n', &[[0, 6, 0, 0], [0, 0, 4, 6], [4, 6, 4, 0]]),
    ('t', &[[0, 0, 4, 0], [2, 0, 2, 6]]),
    ('s', &[[4, 0, 0, 1], [0, 1, 4, 4], [4, 4, 3, 6], [3, 6, 0, 6]]),
    ('i', &[[2, 0, 2, 6]]),
    ('d', &[[0, 0, 0, 6], [0, 0, 4, 2], [4, 2, 4, 4], [4, 4, 0, 6]]),
    ('e', &[[0, 0, 0, 6], [0, 0, 4, 0], [0, 3, 3, 3], [0, 6, 4, 6]]),
    ('b', &[[0, 0, 0, 6], [0, 0, 3, 1], [3, 1, 0, 3], [0, 3, 4, 5], [4, 5, 0, 6]]),
    ('a', &[[0, 6, 2, 0], [2, 0, 4, 6], [1, 4, 3, 4]]),
    ('c', &[[4, 1, 2, 0], [2, 0, 0, 3], [0, 3, 2, 6], [2, 6, 4, 5]]),
    ('k', &[[0, 0, 0, 6], [4, 0, 0, 3], [0, 3, 4, 6]]),
    ('4', &[[3, 6, 3, 0], [3, 0, 0, 4], [0, 4, 4, 4]]),
];

/// How one page looks.
struct Style {
    paper: [f64; 3],
    ink: [f64; 3],
    /// The fill, if it is coloured, and whether it is shaded.
    fill: Option<([f64; 3], bool)>,
}

impl Style {
    /// Draws a view of ink, mask and normals with its upper left corner at a place.
    fn paint(
        &self,
        picture: &mut RgbImage,
        (ink, mask, normals): (&GrayImage, &GrayImage, &RgbImage),
        (left, top): (u32, u32),
    ) {
        for (x, y, share) in ink.enumerate_pixels() {
            let inside = f64::from(mask.get_pixel(x, y).0[0]) / 255.0;
            let ink = f64::from(share.0[0]) / 255.0;
            let normal = normals.get_pixel(x, y).0.map(|n| f64::from(n) / 127.5 - 1.0);
            let light = (0.65 + 0.3 * normal[1] + 0.2 * normal[0]).clamp(0.35, 1.1);
            let pixel = picture.get_pixel_mut(left + x, top + y);
            for c in 0..3 {
                let mut level = f64::from(pixel.0[c]);
                if let Some((fill, shaded)) = self.fill {
                    let fill = if shaded { fill[c] * light } else { fill[c] };
                    level += (fill - level) * inside;
                }
                level += (self.ink[c] - level) * ink;
                pixel.0[c] = level.clamp(0.0, 255.0) as u8;
            }
        }
    }
}

struct Composer<'a> {
    random: &'a mut ChaCha8Rng,
    picture: RgbImage,
    /// What is taken, with some paper about it.
    taken: GrayImage,
    style: Style,
    height: f64,
}

/// Composes a page of `subject` with other subjects' drawings as props.
pub(crate) fn compose(subject: &Subject, others: &[Subject], random: &mut ChaCha8Rng) -> Page {
    let count = random.random_range(2..=8_usize);
    let orders = ORDERS[count - 2];
    let order = orders[random.random_range(0..orders.len())];
    let rows = if count >= 4 { random.random_range(1..=if count >= 6 { 3 } else { 2 }) } else { 1 };
    let height = random.random_range(170.0..400.0_f64);
    let widest = subject.views.iter().map(|v| f64::from(v.ink.width()) / f64::from(v.ink.height()));
    let widest = widest.fold(0.3, f64::max);
    let height = height.min(420.0 / widest).max(90.0);
    let columns = count.div_ceil(rows);
    let page_w = (columns as f64 * height * (widest + 0.35) + 1.2 * height) as u32;
    let page_h = ((rows as f64 * 1.45 + 0.3) * height) as u32;
    let mut traits = Vec::new();
    let style = style(random, &mut traits);
    let paper = Rgb(style.paper.map(|level| level as u8));
    let mut own = Composer {
        random,
        picture: RgbImage::from_pixel(page_w, page_h, paper),
        taken: GrayImage::new(page_w, page_h),
        style,
        height,
    };
    let mut chance = |p: f64, name: &'static str, own: &mut Composer<'_>| {
        let is = own.random.random_bool(p);
        if is {
            traits.push(name);
        }
        is
    };
    let guides = chance(0.3, "guides", &mut own);
    let ground = chance(0.2, "ground", &mut own);
    let captions = chance(0.5, "captions", &mut own);
    let heads = chance(0.3, "heads", &mut own);
    let props = chance(0.35, "props", &mut own);
    let swatches = chance(0.3, "swatches", &mut own);
    let framed = chance(0.15, "frame", &mut own);
    let scaled = chance(0.4, "scales", &mut own);
    let tight = chance(0.35, "overlapping columns", &mut own);
    let mut truth = Vec::new();
    for row in 0..rows {
        let ground_row = (row as f64 * 1.45 + 1.25) * height;
        if guides {
            for share in [0.0, 0.35, 0.6, 1.0] {
                own.level_line(ground_row - share * height, 0.01, 0.99);
            }
        } else if ground {
            own.level_line(ground_row, 0.03, 0.97);
        }
        let from = row * columns;
        let mut first = true;
        let mut left = height * own.random.random_range(0.3..0.5);
        for &step in &order[from..count.min(from + columns)] {
            let scale = if scaled { own.random.random_range(0.8..1.0) } else { 1.0 };
            let jitter = if scaled { own.random.random_range(-0.04..0.04) * height } else { 0.0 };
            let view = &subject.views[step];
            let gap = if tight { -0.25 } else { own.random.random_range(0.06..0.25) };
            // The first of a row has paper on its left.
            if !std::mem::take(&mut first) {
                left += gap * height;
            }
            let placed = own.place(view, left, ground_row + jitter, scale * height, 0.02);
            let Some((bounds, alone)) = placed else {
                continue;
            };
            left = f64::from(bounds[2]);
            if captions {
                let text = ["front", "3 4", "side", "3 4", "back", "3 4", "side", "3 4"][step];
                let middle = f64::from(bounds[0] + bounds[2]) / 2.0;
                let top = f64::from(bounds[3]) + own.random.random_range(0.04..0.09) * height;
                let room = 0.9 * f64::from(bounds[2] - bounds[0]) / text.chars().count() as f64;
                own.text(text, middle, top, (0.05 * height).min(room).max(8.0));
            }
            truth.push(Placed {
                bounds,
                azimuth_deg: step as f64 * STEP_DEG,
                tellable: subject.tellable[step],
                alone,
            });
        }
    }
    own.trim(&truth, if heads || props { 1.3 } else { 0.45 });
    let count = 3;
    if heads {
        for _ in 0..own.random.random_range(1..=count) {
            let view = top_of(&subject.views[own.random.random_range(0..8)]);
            let size = own.random.random_range(0.22..0.42);
            own.beside(&view, size * height);
        }
    }
    if props && !others.is_empty() {
        for _ in 0..own.random.random_range(1..=count) {
            let other = &others[own.random.random_range(0..others.len())];
            let size = own.random.random_range(0.15..0.45);
            let view = own.random.random_range(0..8);
            own.beside(&other.views[view], size * height);
        }
    }
    if swatches {
        own.swatches();
    }
    if framed {
        own.frame();
    }
    own.spoil(&mut traits);
    Page { picture: own.picture, truth, traits }
}

fn style(random: &mut ChaCha8Rng, traits: &mut Vec<&'static str>) -> Style {
    let papers = [[255.0, 255.0, 255.0], [250.0, 246.0, 232.0], [196.0, 214.0, 236.0], [225.0; 3]];
    let paper = papers[[0, 0, 1, 2, 3][random.random_range(0..5)]];
    let ink = if random.random_bool(0.7) { [20.0; 3] } else { [70.0, 60.0, 60.0] };
    let fill = random.random_bool(0.5).then(|| {
        let hue: [f64; 3] = std::array::from_fn(|_| random.random_range(60.0..235.0));
        (hue, random.random_bool(0.5))
    });
    traits.push(match fill {
        None => "line art",
        Some((_, false)) => "flat colour",
        Some(_) => "shaded",
    });
    Style { paper, ink, fill }
}

/// The upper fifth or so of a view.
fn top_of(view: &Drawn) -> Drawn {
    let (w, h) = view.ink.dimensions();
    let h = (h / 4).max(8).min(h);
    let cut = |image: &GrayImage| imageops::crop_imm(image, 0, 0, w, h).to_image();
    let mask = cut(&view.mask);
    // The neck is closed by a stroke.
    let mut ink = cut(&view.ink);
    for x in 0..w {
        if mask.get_pixel(x, h - 1).0[0] > 0 {
            (h - 2..h).for_each(|y| ink.put_pixel(x, y, image::Luma([255])));
        }
    }
    let columns: Vec<u32> =
        (0..w).filter(|&x| (0..h).any(|y| mask.get_pixel(x, y).0[0] > 0)).collect();
    let (x, count) = match (columns.first(), columns.last()) {
        (Some(first), Some(last)) => (*first, last - first + 1),
        _ => (0, w),
    };
    let narrow = |image: &GrayImage| imageops::crop_imm(image, x, 0, count, h).to_image();
    let normals = imageops::crop_imm(&view.normals, x, 0, count, h).to_image();
    Drawn { ink: narrow(&ink), mask: narrow(&mask), normals }
}

impl Composer<'_> {
    /// Puts a view at or right of `left`, where `clear` of its height about it is
    /// free; its bounds and the drawing alone, or nothing if it does not fit.
    fn place(
        &mut self,
        view: &Drawn,
        left: f64,
        ground: f64,
        tall: f64,
        clear: f64,
    ) -> Option<([u32; 4], RgbImage)> {
        let scale = tall / f64::from(view.ink.height());
        let (w, h) = (f64::from(view.ink.width()) * scale, tall.round() as u32);
        let w = (w.round() as u32).max(2);
        let resized = |image: &GrayImage| imageops::resize(image, w, h, FilterType::Triangle);
        let (ink, mask) = (resized(&view.ink), resized(&view.mask));
        let normals = imageops::resize(&view.normals, w, h, FilterType::Triangle);
        let top = (ground - f64::from(h)).max(2.0) as u32;
        let near = (clear * tall).ceil().max(4.0) as i64;
        let mut x = left.max(4.0) as u32;
        while self.collides(&ink, &mask, x, top, near) {
            x += 2;
            if x + w >= self.picture.width() {
                return None;
            }
        }
        if x + w + 2 >= self.picture.width() || top + h + 2 >= self.picture.height() {
            return None;
        }
        self.paint(&ink, &mask, &normals, x, top);
        Some(([x, top, x + w, top + h], self.alone(&ink, &mask, &normals)))
    }

    fn collides(&self, ink: &GrayImage, mask: &GrayImage, left: u32, top: u32, near: i64) -> bool {
        let (w, h) = self.taken.dimensions();
        let is = |x: u32, y: u32| ink.get_pixel(x, y).0[0] > 60 || mask.get_pixel(x, y).0[0] > 60;
        (0..ink.height()).step_by(2).any(|y| {
            (0..ink.width()).step_by(2).any(|x| {
                is(x, y)
                    && [(0, 0), (near, 0), (-near, 0), (0, near), (0, -near)].iter().any(
                        |(dx, dy)| {
                            let (u, v) = (i64::from(left + x) + dx, i64::from(top + y) + dy);
                            u >= 0
                                && v >= 0
                                && u < i64::from(w)
                                && v < i64::from(h)
                                && self.taken.get_pixel(u as u32, v as u32).0[0] > 0
                        },
                    )
            })
        })
    }

    fn paint(
        &mut self,
        ink: &GrayImage,
        mask: &GrayImage,
        normals: &RgbImage,
        left: u32,
        top: u32,
    ) {
        for (x, y, share) in ink.enumerate_pixels() {
            if mask.get_pixel(x, y).0[0] > 51 || share.0[0] > 51 {
                self.taken.put_pixel(left + x, top + y, image::Luma([255]));
            }
        }
        self.style.paint(&mut self.picture, (ink, mask, normals), (left, top));
    }

    fn alone(&self, ink: &GrayImage, mask: &GrayImage, normals: &RgbImage) -> RgbImage {
        let margin = ink.height() / 10 + 4;
        let (w, h) = (ink.width() + 2 * margin, ink.height() + 2 * margin);
        let mut picture = RgbImage::from_pixel(w, h, Rgb(self.style.paper.map(|v| v as u8)));
        self.style.paint(&mut picture, (ink, mask, normals), (margin, margin));
        picture
    }

    /// Cuts off what is bare on the page's right, but for some of a figure's height.
    fn trim(&mut self, truth: &[Placed], bare: f64) {
        let last = truth.iter().map(|view| view.bounds[2]).max().unwrap_or(0);
        let width = (last + (bare * self.height) as u32).min(self.picture.width());
        let h = self.picture.height();
        self.picture = imageops::crop_imm(&self.picture, 0, 0, width, h).to_image();
        self.taken = imageops::crop_imm(&self.taken, 0, 0, width, h).to_image();
    }

    /// Puts a drawing anywhere it fits, clear of all others.
    fn beside(&mut self, view: &Drawn, tall: f64) {
        for _ in 0..40 {
            let x = self.random.random_range(0.0..f64::from(self.picture.width()));
            let y = self.random.random_range(0.0..f64::from(self.picture.height()));
            let scale = tall / f64::from(view.ink.height());
            let w = f64::from(view.ink.width()) * scale;
            let fits = x + w + 8.0 < f64::from(self.picture.width()) && y > tall + 8.0;
            // `place` would move it to the right, which may be too near to its left.
            if fits && !self.crowded(x, y - tall, w, tall) {
                self.place(view, x, y, tall, 0.0);
                return;
            }
        }
    }

    fn crowded(&self, left: f64, top: f64, w: f64, h: f64) -> bool {
        let near = 0.06 * self.height;
        let (w0, h0) = self.taken.dimensions();
        let from = |v: f64| (v - near).max(0.0) as u32;
        (from(top)..((top + h + near) as u32).min(h0)).step_by(2).any(|y| {
            (from(left)..((left + w + near) as u32).min(w0))
                .step_by(2)
                .any(|x| self.taken.get_pixel(x, y).0[0] > 0)
        })
    }

    fn stroke(&mut self, x0: f64, y0: f64, x1: f64, y1: f64, width: f64, taken: bool) {
        let steps = ((x1 - x0).abs().max((y1 - y0).abs()) * 2.0).ceil().max(1.0);
        let half = (width / 2.0).max(0.5);
        let ink = Rgb(self.style.ink.map(|level| level as u8));
        for k in 0..=steps as u32 {
            let t = f64::from(k) / steps;
            let (x, y) = (x0 + (x1 - x0) * t, y0 + (y1 - y0) * t);
            for v in (y - half).round() as i64..(y + half).round() as i64 {
                for u in (x - half).round() as i64..(x + half).round() as i64 {
                    let (w, h) = self.picture.dimensions();
                    if u >= 0 && v >= 0 && u < i64::from(w) && v < i64::from(h) {
                        self.picture.put_pixel(u as u32, v as u32, ink);
                        if taken {
                            self.taken.put_pixel(u as u32, v as u32, image::Luma([255]));
                        }
                    }
                }
            }
        }
    }

    fn text(&mut self, text: &str, middle: f64, top: f64, tall: f64) {
        let unit = tall / 6.0;
        let advance = 6.0 * unit;
        let mut x = middle - advance * text.chars().count() as f64 / 2.0;
        for character in text.chars() {
            let glyph = GLYPHS.iter().find(|(c, _)| *c == character);
            let slash: &[[u8; 4]] = &[[4, 0, 0, 6]];
            let three: &[[u8; 4]] = &[[0, 0, 4, 0], [4, 0, 2, 2], [2, 2, 4, 4], [4, 4, 0, 6]];
            let strokes = match character {
                ' ' => slash,
                '3' => three,
                _ => glyph.map_or(slash, |(_, strokes)| strokes),
            };
            for [x0, y0, x1, y1] in strokes {
                let at = |v: &u8| f64::from(*v) * unit;
                self.stroke(
                    x + at(x0),
                    top + at(y0),
                    x + at(x1),
                    top + at(y1),
                    (0.1 * tall).max(1.2),
                    true,
                );
            }
            x += advance;
        }
    }

    fn level_line(&mut self, y: f64, from: f64, to: f64) {
        let w = f64::from(self.picture.width());
        self.stroke(from * w, y, to * w, y, 1.4, false);
    }

    fn swatches(&mut self) {
        let side = 0.12 * self.height;
        let count = self.random.random_range(3..=6);
        let (x, y) = (0.1 * self.height, f64::from(self.picture.height()) - 1.5 * side);
        if self.crowded(x, y, f64::from(count) * 1.3 * side, side) {
            return;
        }
        for k in 0..count {
            let colour: [u8; 3] = std::array::from_fn(|_| self.random.random_range(30..230));
            let left = x + f64::from(k) * 1.3 * side;
            for v in y as u32..(y + side) as u32 {
                for u in left as u32..(left + side) as u32 {
                    if u < self.picture.width() && v < self.picture.height() {
                        self.picture.put_pixel(u, v, Rgb(colour));
                        self.taken.put_pixel(u, v, image::Luma([255]));
                    }
                }
            }
        }
    }

    fn frame(&mut self) {
        let (w, h) = (f64::from(self.picture.width()), f64::from(self.picture.height()));
        let inset = 0.035 * self.height;
        let (l, t, r, b) = (inset, inset, w - inset, h - inset);
        for (x0, y0, x1, y1) in [(l, t, r, t), (r, t, r, b), (r, b, l, b), (l, b, l, t)] {
            self.stroke(x0, y0, x1, y1, 2.0, true);
        }
    }

    /// Noise and compression.
    fn spoil(&mut self, traits: &mut Vec<&'static str>) {
        if self.random.random_bool(0.4) {
            traits.push("noise");
            let spread = self.random.random_range(1.0..5.0);
            for level in self.picture.iter_mut() {
                let sum: f64 = (0..4).map(|_| self.random.random_range(-1.0..1.0)).sum();
                *level = (f64::from(*level) + spread * sum * 0.87).clamp(0.0, 255.0) as u8;
            }
        }
        if self.random.random_bool(0.5) {
            traits.push("JPEG");
            let quality = self.random.random_range(60..95);
            let mut bytes = std::io::Cursor::new(Vec::new());
            let mut encoder =
                image::codecs::jpeg::JpegEncoder::new_with_quality(&mut bytes, quality);
            encoder.encode_image(&self.picture).expect("the page as JPEG");
            let decoded = image::load_from_memory(bytes.get_ref()).expect("what was encoded");
            self.picture = decoded.into_rgb8();
        }
    }
}
