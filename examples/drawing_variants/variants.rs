//! What studios send instead of clean lines on white: paper, alpha, clutter,
//! gaps, fills, sizes, each made from a clean view.

use image::{GrayImage, Luma, Rgba, RgbaImage, imageops};

/// A variant's name and how it is made: the drawing and its true mask.
pub(crate) type Variant = (&'static str, fn(&Clean, u32) -> (RgbaImage, GrayImage));

/// A clean view and its filled outline.
pub(crate) struct Clean {
    pub(crate) view: GrayImage,
    pub(crate) mask: GrayImage,
}

impl Clean {
    pub(crate) fn new(view: GrayImage) -> Self {
        let mask = filled(&view);
        Self { view, mask }
    }
}

/// What paper does not reach from the border, gaps of a pixel closed.
fn filled(view: &GrayImage) -> GrayImage {
    let (w, h) = view.dimensions();
    let ink = |x: u32, y: u32| view.get_pixel(x, y).0[0] < 204;
    let near = |x: u32, y: u32| {
        (y.saturating_sub(1)..(y + 2).min(h))
            .any(|v| (x.saturating_sub(1)..(x + 2).min(w)).any(|u| ink(u, v)))
    };
    let mut outside = GrayImage::new(w, h);
    let mut pending: Vec<(u32, u32)> = vec![(0, 0), (w - 1, 0), (0, h - 1), (w - 1, h - 1)];
    while let Some((x, y)) = pending.pop() {
        if outside.get_pixel(x, y).0[0] != 0 || near(x, y) {
            continue;
        }
        outside.put_pixel(x, y, Luma([255]));
        let around = [(x.wrapping_sub(1), y), (x + 1, y), (x, y.wrapping_sub(1)), (x, y + 1)];
        pending.extend(around.into_iter().filter(|(x, y)| *x < w && *y < h));
    }
    GrayImage::from_fn(w, h, |x, y| {
        let touched = (y.saturating_sub(1)..(y + 2).min(h)).any(|v| {
            (x.saturating_sub(1)..(x + 2).min(w)).any(|u| outside.get_pixel(u, v).0[0] != 0)
        });
        Luma([if touched && !ink(x, y) { 0 } else { 255 }])
    })
}

/// Intersection over union.
pub(crate) fn iou(a: &GrayImage, b: &GrayImage) -> f64 {
    let pairs = a.as_raw().iter().zip(b.as_raw());
    let (mut both, mut either) = (0.0, 0.0);
    for (a, b) in pairs {
        both += f64::from(u8::from(*a >= 128 && *b >= 128));
        either += f64::from(u8::from(*a >= 128 || *b >= 128));
    }
    both / f64::max(either, 1.0)
}

/// A small reproducible generator.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 33) as f64 / (1_u64 << 31) as f64
    }

    fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.next()).sum::<f64>() - 6.0
    }
}

fn opaque(view: &GrayImage) -> RgbaImage {
    RgbaImage::from_fn(view.width(), view.height(), |x, y| {
        let level = view.get_pixel(x, y).0[0];
        Rgba([level, level, level, 255])
    })
}

fn mapped(clean: &Clean, map: impl Fn(u32, u32, f64, bool) -> [f64; 3]) -> (RgbaImage, GrayImage) {
    let image = RgbaImage::from_fn(clean.view.width(), clean.view.height(), |x, y| {
        let inside = clean.mask.get_pixel(x, y).0[0] != 0;
        let level = f64::from(clean.view.get_pixel(x, y).0[0]);
        let [r, g, b] = map(x, y, level, inside).map(|v| v.round().clamp(0.0, 255.0) as u8);
        Rgba([r, g, b, 255])
    });
    (image, clean.mask.clone())
}

fn bounds(mask: &GrayImage) -> [u32; 4] {
    let inside = mask.enumerate_pixels().filter(|(_, _, p)| p.0[0] != 0);
    inside.fold([u32::MAX, u32::MAX, 0, 0], |b, (x, y, _)| {
        [b[0].min(x), b[1].min(y), b[2].max(x), b[3].max(y)]
    })
}

fn rectangle(image: &mut RgbaImage, [x0, y0, x1, y1]: [u32; 4], level: u8) {
    for y in y0..y1.min(image.height()) {
        for x in x0..x1.min(image.width()) {
            image.put_pixel(x, y, Rgba([level, level, level, 255]));
        }
    }
}

/// Letters of bars, 16 px tall.
fn caption(image: &mut RgbaImage, left: u32, top: u32, unit: u32) {
    for k in 0..6 {
        let x = left + k * 6 * unit;
        rectangle(image, [x, top, x + unit, top + 8 * unit], 0);
        if k % 2 == 0 {
            rectangle(image, [x, top, x + 4 * unit, top + unit], 0);
        }
        if k % 3 != 1 {
            rectangle(image, [x, top + 4 * unit, x + 4 * unit, top + 5 * unit], 0);
            rectangle(image, [x + 3 * unit, top + 4 * unit, x + 4 * unit, top + 8 * unit], 0);
        }
    }
}

fn captioned(image: &mut RgbaImage, clean: &Clean) {
    let [x0, _, x1, y1] = bounds(&clean.mask);
    let (_, h) = image.dimensions();
    let top = (y1 + 6).min(h - 18);
    let left = if top <= y1 + 2 { x1 + 20 } else { (x0 + x1) / 2 - 36 };
    caption(image, left, top, 2);
}

fn gaps(clean: &Clean, diameter: f64, seed: u32) -> (RgbaImage, GrayImage) {
    let (w, h) = clean.mask.dimensions();
    let is = |x: u32, y: u32| clean.mask.get_pixel(x, y).0[0] != 0;
    let mut outline = Vec::new();
    for y in 1..h - 1 {
        for x in 1..w - 1 {
            if is(x, y) && !(is(x - 1, y) && is(x + 1, y) && is(x, y - 1) && is(x, y + 1)) {
                outline.push((f64::from(x), f64::from(y)));
            }
        }
    }
    let mut random = Random(u64::from(seed) * 977 + 5);
    let mut centres: Vec<(f64, f64)> = Vec::new();
    for _ in 0..2000 {
        let place = outline[(random.next() * outline.len() as f64) as usize % outline.len()];
        let apart = centres.iter().all(|c| (c.0 - place.0).hypot(c.1 - place.1) > 2.0 * diameter);
        if apart && centres.len() < 6 {
            centres.push(place);
        }
    }
    let mut view = clean.view.clone();
    for (x, y, pixel) in view.enumerate_pixels_mut() {
        if centres.iter().any(|c| (c.0 - f64::from(x)).hypot(c.1 - f64::from(y)) < diameter / 2.0) {
            pixel.0[0] = 255;
        }
    }
    (opaque(&view), clean.mask.clone())
}

fn noisy(clean: &Clean, seed: u32, sigma: f64, ink: f64) -> (RgbaImage, GrayImage) {
    let mut random = Random(u64::from(seed) + 3);
    let mut image = opaque(&clean.view);
    for pixel in image.pixels_mut() {
        let level = 245.0 - (255.0 - f64::from(pixel.0[0])) * ink + random.normal() * sigma;
        let level = level.round().clamp(0.0, 255.0) as u8;
        pixel.0 = [level, level, level, 255];
    }
    (image, clean.mask.clone())
}

fn resized(clean: &Clean, w: u32, h: u32) -> (RgbaImage, GrayImage) {
    let view = imageops::resize(&clean.view, w, h, imageops::FilterType::Triangle);
    let mask = filled(&view);
    (opaque(&view), mask)
}

fn jpeg(image: RgbaImage, quality: u8) -> RgbaImage {
    let rgb = image::DynamicImage::ImageRgba8(image).to_rgb8();
    let mut bytes = Vec::new();
    image::codecs::jpeg::JpegEncoder::new_with_quality(&mut bytes, quality)
        .encode_image(&rgb)
        .unwrap();
    image::load_from_memory(&bytes).unwrap().to_rgba8()
}

pub(crate) const VARIANTS: &[Variant] = &[
    ("clean", |c, _| (opaque(&c.view), c.mask.clone())),
    ("ink layer", |c, _| {
        let image = RgbaImage::from_fn(c.view.width(), c.view.height(), |x, y| {
            Rgba([0, 0, 0, 255 - c.view.get_pixel(x, y).0[0]])
        });
        (image, c.mask.clone())
    }),
    ("palette transparency", |c, _| {
        let image = RgbaImage::from_fn(c.view.width(), c.view.height(), |x, y| {
            let level = c.view.get_pixel(x, y).0[0] / 16 * 17;
            if level == 255 { Rgba([0; 4]) } else { Rgba([level, level, level, 255]) }
        });
        (image, c.mask.clone())
    }),
    ("40 transparent pixels", |c, _| {
        let mut image = opaque(&c.view);
        (0..40).for_each(|k| image.put_pixel(5 + k, 7, Rgba([0; 4])));
        (image, c.mask.clone())
    }),
    ("cut out", |c, _| {
        let image = RgbaImage::from_fn(c.view.width(), c.view.height(), |x, y| {
            let level = c.view.get_pixel(x, y).0[0];
            Rgba([level, level, level, c.mask.get_pixel(x, y).0[0]])
        });
        (image, c.mask.clone())
    }),
    ("cut by the bottom edge", |c, _| {
        let [_, y0, _, y1] = bounds(&c.mask);
        let h = y1 - (y1 - y0) / 6;
        let crop = |i: &GrayImage| imageops::crop_imm(i, 0, 0, i.width(), h).to_image();
        (opaque(&crop(&c.view)), crop(&c.mask))
    }),
    ("cut by the side", |c, _| {
        let [x0, _, x1, _] = bounds(&c.mask);
        let w = x1 - (x1 - x0) / 8;
        let crop = |i: &GrayImage| imageops::crop_imm(i, 0, 0, w, i.height()).to_image();
        (opaque(&crop(&c.view)), crop(&c.mask))
    }),
    ("cropped and scaled", |c, k| {
        let [x0, y0, x1, y1] = bounds(&c.mask);
        let m = 6 + k * 3;
        let (x0, y0) = (x0.saturating_sub(m), y0.saturating_sub(m));
        let (w, h) = (x1 + m - x0, y1 + m - y0);
        let crop = |i: &GrayImage| imageops::crop_imm(i, x0, y0, w, h).to_image();
        let crop = Clean { view: crop(&c.view), mask: crop(&c.mask) };
        let scale = [0.8, 1.0, 1.2, 0.93, 1.1][k as usize % 5];
        resized(&crop, (f64::from(w) * scale) as u32, (f64::from(h) * scale) as u32)
    }),
    ("frame and caption", |c, _| {
        let mut image = opaque(&c.view);
        let (w, h) = image.dimensions();
        captioned(&mut image, c);
        for [x0, y0, x1, y1] in
            [[2, 2, w - 2, 6], [2, h - 6, w - 2, h - 2], [2, 2, 6, h - 2], [w - 6, 2, w - 2, h - 2]]
        {
            rectangle(&mut image, [x0, y0, x1, y1], 0);
        }
        (image, c.mask.clone())
    }),
    ("frame at the border", |c, _| {
        let mut image = opaque(&c.view);
        let (w, h) = image.dimensions();
        for r in [[0, 0, w, 4], [0, h - 4, w, h], [0, 0, 4, h], [w - 4, 0, w, h]] {
            rectangle(&mut image, r, 0);
        }
        (image, c.mask.clone())
    }),
    ("inner frame, grey", |c, _| {
        let pad = |i: &GrayImage, level: u8| {
            let mut page = GrayImage::from_pixel(i.width(), i.height() + 80, Luma([level]));
            imageops::replace(&mut page, i, 0, 40);
            page
        };
        let c = &Clean { view: pad(&c.view, 255), mask: pad(&c.mask, 0) };
        let mut image = opaque(&c.view);
        let [x0, y0, x1, y1] = bounds(&c.mask);
        let m = 12;
        let (x0, y0, x1, y1) =
            (x0 - m, y0.saturating_sub(m), x1 + m, (y1 + m).min(c.view.height() - 3));
        for r in
            [[x0, y0, x1, y0 + 2], [x0, y1 - 2, x1, y1], [x0, y0, x0 + 2, y1], [x1 - 2, y0, x1, y1]]
        {
            rectangle(&mut image, r, 90);
        }
        let (x0, x1) = (x0.saturating_sub(20), x1 + 20);
        let crop = |i: &GrayImage| imageops::crop_imm(i, x0, 0, x1 - x0, i.height()).to_image();
        (imageops::crop_imm(&image, x0, 0, x1 - x0, image.height()).to_image(), crop(&c.mask))
    }),
    ("gaps of 11", |c, k| gaps(c, 11.0, k)),
    ("gaps of 20", |c, k| gaps(c, 20.0, k)),
    ("gaps of 40", |c, k| gaps(c, 40.0, k)),
    ("gaps of 40, again", |c, k| gaps(c, 40.0, k + 50)),
    ("gaps of 60", |c, k| gaps(c, 60.0, k)),
    ("white on dark", |c, _| mapped(c, |_, _, l, _| [255.0 - l; 3])),
    ("white on blue", |c, _| {
        mapped(c, |_, _, l, _| {
            [30.0 + (255.0 - l) * 0.85, 60.0 + (255.0 - l) * 0.75, 150.0 + (255.0 - l) * 0.4]
        })
    }),
    ("caption", |c, _| {
        let mut image = opaque(&c.view);
        captioned(&mut image, c);
        (image, c.mask.clone())
    }),
    ("ground line on the soles", |c, _| {
        let mut image = opaque(&c.view);
        let y = bounds(&c.mask)[3];
        let w = image.width();
        rectangle(&mut image, [60, y - 1, w - 60, y + 1], 0);
        (image, c.mask.clone())
    }),
    ("ground line below", |c, _| {
        let mut image = opaque(&c.view);
        let y = bounds(&c.mask)[3];
        let w = image.width();
        rectangle(&mut image, [0, y + 1, w, y + 4], 0);
        (image, c.mask.clone())
    }),
    ("ground line, grey", |c, _| {
        let mut image = opaque(&c.view);
        let [x0, _, x1, y] = bounds(&c.mask);
        rectangle(&mut image, [x0.saturating_sub(70), y, x1 + 70, y + 2], 120);
        (image, c.mask.clone())
    }),
    ("flat grey fill", |c, _| mapped(c, |_, _, l, i| [if i { l.min(170.0) } else { l }; 3])),
    ("flat dark fill", |c, _| mapped(c, |_, _, l, i| [if i { l.min(60.0) } else { l }; 3])),
    ("flat pale fill", |c, _| mapped(c, |_, _, l, i| [if i { l.min(228.0) } else { l }; 3])),
    ("flat colour, no outline", |c, _| {
        mapped(c, |_, y, _, i| {
            if !i {
                [255.0; 3]
            } else if y < 200 {
                [230.0, 180.0, 150.0]
            } else {
                [60.0, 110.0, 190.0]
            }
        })
    }),
    ("shaded, no outline", |c, _| {
        mapped(c, |x, y, _, i| {
            if !i {
                [252.0; 3]
            } else {
                [90.0 + f64::from(x % 300) * 0.4, 180.0 - f64::from(y) * 0.2, 90.0]
            }
        })
    }),
    ("shaded on grey", |c, _| {
        mapped(c, |x, y, l, i| {
            if !i {
                [150.0; 3]
            } else {
                [
                    l.min(90.0 + f64::from(x % 300) * 0.4),
                    l.min(180.0 - f64::from(y) * 0.2),
                    l.min(90.0),
                ]
            }
        })
    }),
    ("white figure on grey", |c, _| {
        mapped(c, |_, _, l, i| if i { [l; 3] } else { [l.min(190.0); 3] })
    }),
    ("jpeg 40", |c, _| (jpeg(opaque(&c.view), 40), c.mask.clone())),
    ("jpeg 40 of flat colour", |c, _| {
        let (image, mask) = mapped(c, |_, y, l, i| {
            if !i {
                [l; 3]
            } else if y < 200 {
                [l.min(230.0), l.min(180.0), l.min(150.0)]
            } else {
                [l.min(60.0), l.min(110.0), l.min(190.0)]
            }
        });
        (jpeg(image, 40), mask)
    }),
    ("noise 8", |c, k| noisy(c, k, 8.0, 0.9)),
    ("noise 20", |c, k| noisy(c, k, 20.0, 0.9)),
    ("pencil, noise 6", |c, k| noisy(c, k, 6.0, 0.4)),
    ("vignette", |c, _| {
        let (w, h) = (f64::from(c.view.width()) / 2.0, f64::from(c.view.height()) / 2.0);
        mapped(c, |x, y, l, _| {
            let r = ((f64::from(x) - w) / w).powi(2) + ((f64::from(y) - h) / h).powi(2);
            [l * (1.0 - 0.25 * r); 3]
        })
    }),
    ("gradient", |c, _| mapped(c, |x, _, l, _| [l * (0.95 - 0.45 * f64::from(x) / 960.0); 3])),
    ("grey paper", |c, _| mapped(c, |_, _, l, _| [l * 0.7, l * 0.7, l * 0.68])),
    ("half size", |c, _| resized(c, c.view.width() / 2, c.view.height() / 2)),
    ("an eighth, flat", |c, _| {
        let filled = Clean {
            view: GrayImage::from_fn(c.view.width(), c.view.height(), |x, y| {
                Luma([c.view.get_pixel(x, y).0[0].min(255 - c.mask.get_pixel(x, y).0[0] / 2)])
            }),
            mask: c.mask.clone(),
        };
        resized(&filled, c.view.width() / 8, c.view.height() / 8)
    }),
    ("four times", |c, _| resized(c, c.view.width() * 4, c.view.height() * 4)),
    ("guides", |c, _| {
        let mut image = opaque(&c.view);
        let [x0, y0, x1, y1] = bounds(&c.mask);
        let (w, h) = image.dimensions();
        for y in [y0, y0 + (y1 - y0) / 7, y0 + (y1 - y0) / 2, y1] {
            rectangle(&mut image, [0, y, w, y + 1], 100);
        }
        rectangle(&mut image, [(x0 + x1) / 2, 0, (x0 + x1) / 2 + 1, h], 100);
        (image, c.mask.clone())
    }),
    ("guides beside", |c, _| {
        let mut image = opaque(&c.view);
        let [x0, y0, x1, _] = bounds(&c.mask);
        let (_, h) = image.dimensions();
        rectangle(&mut image, [x0 - 20, 10, x0 - 18, h - 10], 0);
        rectangle(&mut image, [x1 + 20, y0, x1 + 22, h - 10], 0);
        (image, c.mask.clone())
    }),
    ("detached tuft", |c, _| {
        let mut image = opaque(&c.view);
        let mut mask = c.mask.clone();
        let [_, y0, x1, _] = bounds(&c.mask);
        for y in 0..24_u32 {
            for x in 0..24_u32 {
                let r = (f64::from(x) - 12.0).hypot(f64::from(y) - 12.0);
                let (u, v) = (x1 + 6 + x, y0 + 200 + y);
                if r < 11.0 && u < mask.width() {
                    mask.put_pixel(u, v, Luma([255]));
                    if r > 9.0 {
                        image.put_pixel(u, v, Rgba([0, 0, 0, 255]));
                    }
                }
            }
        }
        (image, mask)
    }),
];
