//! Pages put together at random and then spoiled: whatever comes of it, it is answered or refused,
//! and what is answered lies on the page.
//!
//! A few hundred run as a test. `PAGE_CASES=100000 PAGE_SEED=7 cargo test -p page --test mutated`
//! searches for longer; a failure names the seed of its case.

use image::{Rgba, RgbaImage, imageops};
use page::{PageOptions, cut_box, cut_out, outline_of, preview, propose, propose_all};
use progress::Silent;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

fn number(name: &str, usual: u64) -> u64 {
    std::env::var(name).ok().and_then(|text| text.parse().ok()).unwrap_or(usual)
}

fn colour(random: &mut ChaCha8Rng) -> Rgba<u8> {
    let alpha = *[255, 255, 255, 128, 0].get(random.random_range(0..5)).unwrap();
    if random.random_bool(0.5) {
        let grey = random.random_range(0..=90);
        return Rgba([grey, grey, grey, alpha]);
    }
    Rgba([random.random(), random.random(), random.random(), alpha])
}

/// Sides that are usual, tiny, or as thin as a line.
fn size(random: &mut ChaCha8Rng) -> (u32, u32) {
    let side = |random: &mut ChaCha8Rng| match random.random_range(0..12) {
        0 => random.random_range(1..6),
        1 => random.random_range(6..40),
        2 => random.random_range(500..900),
        _ => random.random_range(80..420),
    };
    (side(random), side(random))
}

/// Blocks, discs, rings, lines, letters and dirt.
fn scribble(page: &mut RgbaImage, random: &mut ChaCha8Rng) {
    let (width, height) = (page.width() as i32, page.height() as i32);
    let ink = colour(random);
    let (x, y) = (random.random_range(-20..width + 20), random.random_range(-20..height + 20));
    let (w, h) = (random.random_range(1..=width.max(2)), random.random_range(1..=height.max(2)));
    let (w, h) = match random.random_range(0..4) {
        0 => (w, 1 + h / 60),
        1 => (1 + w / 60, h),
        2 => (1 + w / 6, 1 + h / 3),
        _ => (1 + w / 3, 1 + h / 2),
    };
    let stroke = random.random_range(1..5);
    let kind = random.random_range(0..5);
    let mut put = |x: i32, y: i32| {
        if (0..width).contains(&x) && (0..height).contains(&y) {
            page.put_pixel(x as u32, y as u32, ink);
        }
    };
    for (dx, dy) in (0..h).flat_map(|dy| (0..w).map(move |dx| (dx, dy))) {
        let (u, v) = (
            (f64::from(dx) + 0.5) / f64::from(w) * 2.0 - 1.0,
            (f64::from(dy) + 0.5) / f64::from(h) * 2.0 - 1.0,
        );
        let edge = dx.min(w - 1 - dx).min(dy.min(h - 1 - dy)) < stroke;
        let thin = 2.0 * f64::from(stroke) / f64::from(w.min(h));
        let drawn = match kind {
            0 => true,
            1 => edge,
            2 => u.hypot(v) < 1.0,
            3 => u.hypot(v) < 1.0 && u.hypot(v) > 1.0 - thin,
            _ => (dx / 3 + dy / 5) % 3 == 0,
        };
        if drawn {
            put(x + dx, y + dy);
        }
    }
}

/// The same drawing several times, as views have it.
fn repeat(page: &mut RgbaImage, random: &mut ChaCha8Rng) {
    let (width, height) = page.dimensions();
    if width < 8 || height < 8 {
        return;
    }
    let (w, h) = (random.random_range(2..=width / 2), random.random_range(2..=height / 2));
    let from = (random.random_range(0..=width - w), random.random_range(0..=height - h));
    let part = imageops::crop_imm(page, from.0, from.1, w, h).to_image();
    for _ in 0..random.random_range(1..6) {
        let to = (random.random_range(0..width), random.random_range(0..height));
        imageops::replace(page, &part, to.0.into(), to.1.into());
    }
}

/// What happens to files: noise, negatives, lost alpha, crops, flat stripes.
fn spoil(page: &mut RgbaImage, random: &mut ChaCha8Rng) {
    match random.random_range(0..8) {
        0 => page.pixels_mut().for_each(|pixel| {
            let noise: i16 = random.random_range(-40..40);
            for level in &mut pixel.0[..3] {
                *level = (i16::from(*level) + noise).clamp(0, 255) as u8;
            }
        }),
        1 => imageops::invert(page),
        2 => page.pixels_mut().for_each(|pixel| pixel.0[3] = random.random()),
        3 => {
            let (w, h) = page.dimensions();
            let (w, h) = (random.random_range(1..=w), random.random_range(1..=h));
            *page = imageops::crop_imm(page, 0, 0, w, h).to_image();
        }
        4 => {
            let paper = colour(random);
            let rows = random.random_range(0..=page.height());
            for (_, y, pixel) in page.enumerate_pixels_mut() {
                if y < rows {
                    *pixel = paper;
                }
            }
        }
        5 => {
            let (w, h) = size(random);
            *page = imageops::resize(page, w, h, imageops::FilterType::Nearest);
        }
        6 => page.pixels_mut().step_by(random.random_range(2..9)).for_each(|p| p.0 = [0; 4]),
        _ => {}
    }
}

fn page_of(random: &mut ChaCha8Rng) -> RgbaImage {
    let (width, height) = size(random);
    let paper = if random.random_bool(0.7) { Rgba([255; 4]) } else { colour(random) };
    let mut page = RgbaImage::from_pixel(width, height, paper);
    for _ in 0..random.random_range(0..14) {
        match random.random_range(0..4) {
            0 => repeat(&mut page, random),
            _ => scribble(&mut page, random),
        }
    }
    for _ in 0..random.random_range(0..3) {
        spoil(&mut page, random);
    }
    page
}

fn check(seed: u64) {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let page = page_of(&mut random);
    let working_side_px = *[64, 256, 1600].get(random.random_range(0..3)).unwrap();
    let options = PageOptions { working_side_px, ..PageOptions::default() };
    let (width, height) = page.dimensions();
    let found = propose(&page, &options, &Silent);
    let again = propose(&page, &options, &Silent);
    assert_eq!(format!("{found:?}"), format!("{again:?}"), "twice the same");
    if random.random_bool(0.2) {
        let other = page_of(&mut random);
        let _ = propose_all(&[page.clone(), other], &options, &Silent);
    }
    let Ok(proposal) = found else { return };
    assert!(!proposal.figures.is_empty() && (0.0..=1.0).contains(&proposal.confidence));
    let shown = preview(&page, &proposal);
    assert!(shown.width() > 0 && shown.height() > 0);
    for (index, figure) in proposal.figures.iter().enumerate() {
        let place = figure.place;
        assert!(place.left < place.right && place.right <= width, "{place:?}");
        assert!(place.top < place.bottom && place.bottom <= height, "{place:?}");
        assert_eq!(figure.mask.dimensions(), (place.width(), place.height()));
        assert!(figure.mask.iter().any(|level| *level >= 128), "an empty mask");
        let on_page = |x: f64, y: f64| {
            (0.0..=f64::from(width)).contains(&x) && (0.0..=f64::from(height)).contains(&y)
        };
        assert!(figure.outline.iter().all(|p| on_page(p.x, p.y)), "{:?}", figure.outline);
        assert!(on_page(figure.axis_column, 0.0) && figure.scale.is_finite());
        assert!((0.0..=1.0).contains(&figure.confidence), "{}", figure.confidence);
        let cut = cut_out(&page, &proposal, index);
        let boxed = cut_box(&page, &proposal, &place);
        assert_eq!(cut.dimensions(), boxed.dimensions());
        let _ = outline_of(&figure.mask);
    }
    for left in &proposal.left_out {
        assert!(left.place.right <= width && left.place.bottom <= height, "{left:?}");
    }
}

#[test]
fn spoiled_pages_are_answered_or_refused() {
    let first = number("PAGE_SEED", 1) * 1_000_000;
    for seed in first..first + number("PAGE_CASES", 150) {
        if let Err(panic) = std::panic::catch_unwind(|| check(seed)) {
            eprintln!("PAGE_SEED case {seed}");
            std::panic::resume_unwind(panic);
        }
    }
}
