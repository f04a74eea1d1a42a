//! Pages composed of drawings: what is found on them, and what must not be.

use frames::Azimuth;
use image::{Rgba, RgbaImage};
use page::{LeftOutKind, PageError, PageOptions, PageProposal};
use progress::{Observer, Progress, Silent};
use proptest::prelude::*;

const INK: Rgba<u8> = Rgba([20, 20, 30, 255]);

fn paper(width: u32, height: u32) -> RgbaImage {
    RgbaImage::from_pixel(width, height, Rgba([255, 255, 255, 255]))
}

fn block(page: &mut RgbaImage, left: u32, top: u32, width: u32, height: u32, colour: Rgba<u8>) {
    for y in top..(top + height).min(page.height()) {
        (left..(left + width).min(page.width())).for_each(|x| page.put_pixel(x, y, colour));
    }
}

/// A figure of head, trunk and legs, its nose on one side or none.
fn figure(page: &mut RgbaImage, left: u32, top: u32, nose: i32, face: bool) {
    let skin = Rgba([240, 190, 150, 255]);
    let cloth = Rgba([70, 110, 190, 255]);
    let side = nose != 0;
    let trunk = if side { 44 } else { 80 };
    let middle = left + 40;
    block(page, middle - 20, top, 40, 44, skin);
    block(page, middle - trunk / 2, top + 44, trunk, 90, cloth);
    for leg in if side { vec![0_i32] } else { vec![-20, 20] } {
        block(page, (middle as i32 + leg - 11) as u32, top + 134, 22, 66, skin);
        let toe = (middle as i32 + leg - 11 + nose.min(0) * 14) as u32;
        block(page, toe, top + 190, 22 + 14 * nose.unsigned_abs(), 10, skin);
    }
    if face {
        let shift = nose * 10;
        for eye in [-10_i32, 6] {
            block(page, (middle as i32 + eye + shift) as u32, top + 14, 5, 6, INK);
        }
        block(page, (middle as i32 - 6 + shift) as u32, top + 30, 12, 3, INK);
    }
}

/// Front, side facing left and back, with a swatch, a ground line and a frame.
fn sheet() -> RgbaImage {
    let mut page = paper(700, 400);
    block(&mut page, 40, 300, 620, 2, INK);
    figure(&mut page, 100, 100, 0, true);
    figure(&mut page, 290, 100, -1, true);
    figure(&mut page, 480, 100, 0, false);
    block(&mut page, 600, 60, 24, 24, Rgba([200, 40, 40, 255]));
    for (x, y, w, h) in [(10, 10, 680, 3), (10, 387, 680, 3), (10, 10, 3, 380), (687, 10, 3, 380)] {
        block(&mut page, x, y, w, h, INK);
    }
    page
}

fn degrees(proposal: &PageProposal) -> Vec<f64> {
    proposal.figures.iter().map(|figure| figure.azimuth.degrees()).collect()
}

fn proposed(page: &RgbaImage) -> PageProposal {
    page::propose(page, &PageOptions::default(), &Silent).unwrap()
}

#[test]
fn a_sheet_is_front_side_and_back() {
    let page = sheet();
    let proposal = proposed(&page);
    assert_eq!(degrees(&proposal), [0.0, 90.0, 180.0]);
    for (figure, left) in proposal.figures.iter().zip([100, 290, 480]) {
        assert!(figure.place.top.abs_diff(100) <= 2, "{}", figure.place);
        assert!(figure.baseline_row.abs_diff(300) <= 3, "{}", figure.baseline_row);
        assert!((figure.axis_column - f64::from(left + 40)).abs() < 12.0, "{}", figure.axis_column);
        assert_eq!(figure.mask.dimensions(), (figure.place.width(), figure.place.height()));
        assert!((0.95..1.05).contains(&figure.scale) && figure.outline.len() >= 4);
        assert_eq!(figure.row, 0);
    }
    let kinds: Vec<LeftOutKind> = proposal.left_out.iter().map(|left| left.kind).collect();
    for kind in [LeftOutKind::Frame, LeftOutKind::GroundLine, LeftOutKind::Swatch] {
        assert!(kinds.contains(&kind), "{kinds:?}");
    }
    assert_eq!(page::preview(&page, &proposal).dimensions(), (700, 400));
}

#[test]
fn the_side_faces_the_way_it_is_drawn() {
    let mut page = paper(500, 320);
    figure(&mut page, 80, 60, 0, true);
    figure(&mut page, 300, 60, 1, true);
    assert_eq!(degrees(&proposed(&page)), [0.0, 270.0]);
}

#[test]
fn what_cannot_be_told_is_said_with_doubt() {
    // Nothing tells which way a plain slab's side faces.
    let mut page = paper(500, 320);
    block(&mut page, 80, 60, 110, 200, INK);
    block(&mut page, 320, 60, 40, 200, INK);
    let plain = proposed(&page);
    assert!([90.0, 270.0].contains(&degrees(&plain)[1]), "{:?}", degrees(&plain));
    assert!(plain.figures[1].confidence < 0.6, "{}", plain.figures[1].confidence);
    assert!(plain.confidence <= plain.figures[1].confidence + 1e-9);
    // A nose and toes tell a side, though not for certain.
    let mut page = paper(500, 320);
    figure(&mut page, 80, 60, 0, true);
    figure(&mut page, 300, 60, 1, true);
    let told = proposed(&page).figures[1].confidence;
    assert!((0.4..0.9).contains(&told), "{told}");
}

#[test]
fn a_cut_out_holds_one_view_only() {
    let page = sheet();
    let proposal = proposed(&page);
    let cut = page::cut_out(&page, &proposal, 1);
    assert!(cut.width() < 120 && cut.height() > 200);
    let alone = proposed(&cut);
    assert_eq!(alone.figures.len(), 1);
    let names: Vec<String> = ["a", "b", "c"].map(String::from).to_vec();
    let document = page::sheet_document(std::slice::from_ref(&proposal), &names);
    assert_eq!(document.views[1].azimuth_deg, 90.0);
}

#[test]
fn a_caption_is_left_out_and_painted_over() {
    let mut page = sheet();
    for letter in 0..5 {
        let left = 112 + 12 * letter;
        block(&mut page, left, 312, 2, 12, INK);
        block(&mut page, left + 6, 312, 2, 12, INK);
        block(&mut page, left, 317, 8, 2, INK);
    }
    let proposal = proposed(&page);
    assert!(proposal.left_out.iter().any(|left| left.kind == LeftOutKind::Caption));
    assert_eq!(proposal.figures.len(), 3);
    let cut = page::cut_out(&page, &proposal, 0);
    let place = proposal.figures[0].place;
    let margin = cut.height() - place.height();
    let below = cut.rows().skip((cut.height() - margin / 4) as usize);
    assert!(below.flatten().all(|pixel| pixel.0[0] > 200), "the caption is still there");
}

#[test]
fn guides_are_rubbed_out_of_cut_outs_and_soles_stay() {
    // An outlined body with two feet on a ground line, a guide through its middle, drawn twice.
    let outline = |page: &mut RgbaImage, left: u32| {
        for (x, y, w, h) in [
            (0, 80, 80, 3),
            (0, 80, 3, 180),
            (77, 80, 3, 180),
            (16, 200, 3, 60),
            (61, 200, 3, 60),
            (0, 200, 80, 3),
        ] {
            block(page, left + x, y, w, h, INK);
        }
        block(page, left, 257, 19, 3, INK);
        block(page, left + 61, 257, 19, 3, INK);
    };
    let mut alone = paper(700, 360);
    outline(&mut alone, 120);
    outline(&mut alone, 420);
    let mut page = alone.clone();
    for y in [140, 257] {
        block(&mut page, 20, y, 660, 3, INK);
    }
    let proposal = proposed(&page);
    assert_eq!(proposal.figures.len(), 2);
    for (k, figure) in proposal.figures.iter().enumerate() {
        let cut = page::cut_out(&page, &proposal, k);
        let around = page::with_margin(&figure.place, page.dimensions());
        let same = cut.enumerate_pixels().filter(|(x, y, pixel)| {
            let drawn = alone.get_pixel(x + around.left, y + around.top).0[0];
            drawn.abs_diff(pixel.0[0]) < 60
        });
        let (same, all) = (same.count(), (cut.width() * cut.height()) as usize);
        assert!(same * 100 >= all * 98, "{same} of {all} pixels are as drawn");
        let ink = |columns: std::ops::Range<u32>, row: u32| {
            let row = row - around.top;
            let dark = |x: &u32| cut.get_pixel(x - around.left, row).0[0] < 128;
            columns.clone().filter(dark).count() as f64 / columns.len() as f64
        };
        let left = [120, 420][k];
        // The guide is gone inside and outside, the soles are there.
        assert!(ink(left + 6..left + 74, 141) < 0.05 && ink(left + 84..left + 90, 141) == 0.0);
        assert!(ink(left + 4..left + 15, 258) > 0.9, "the sole went with the ground line");
    }
}

#[test]
fn what_a_figure_encloses_with_a_removed_line_is_of_it() {
    // Open boxes on a ground line, with a screen that touches nothing.
    let mut page = paper(700, 360);
    for left in [120, 420] {
        for (x, y, w, h) in [(0, 80, 160, 3), (0, 80, 3, 180), (157, 80, 3, 180)] {
            block(&mut page, left + x, y, w, h, INK);
        }
        for (x, y, w, h) in
            [(40, 120, 80, 3), (40, 197, 80, 3), (40, 120, 3, 80), (117, 120, 3, 80)]
        {
            block(&mut page, left + x, y, w, h, INK);
        }
    }
    block(&mut page, 20, 257, 660, 3, INK);
    let proposal = proposed(&page);
    assert_eq!(proposal.figures.len(), 2);
    let left: Vec<LeftOutKind> = proposal.left_out.iter().map(|left| left.kind).collect();
    assert_eq!(left, [LeftOutKind::GroundLine]);
    for (k, figure) in proposal.figures.iter().enumerate() {
        let cut = page::cut_out(&page, &proposal, k);
        let around = page::with_margin(&figure.place, page.dimensions());
        let at = |x: u32, y: u32| cut.get_pixel(x - around.left, y - around.top).0[0];
        let left = [120, 420][k];
        assert!(at(left + 80, 121) < 128 && at(left + 118, 160) < 128, "the screen is gone");
        assert!(at(left + 80, 258) < 128, "the lower edge went with the ground line");
    }
}

#[test]
fn edges_of_neighbours_at_one_height_are_no_guide() {
    // Bowls whose rims are level and nearly touch.
    let mut page = paper(760, 300);
    for middle in [200.0, 560.0] {
        for y in 80..230_u32 {
            let half =
                |y: f64| 172.0 * (1.0 - ((y - 80.0) / 150.0).max(0.0).powi(4)).max(0.0).sqrt();
            for x in 0..760_u32 {
                let off = (f64::from(x) - middle).abs();
                let is_edge = off <= half(f64::from(y)) && off > half(f64::from(y) + 3.0) - 3.0;
                let is_rim = y < 83 && off <= half(80.0);
                if is_edge || is_rim {
                    page.put_pixel(x, y, INK);
                }
            }
        }
    }
    let proposal = proposed(&page);
    assert_eq!(proposal.figures.len(), 2);
    for k in 0..2 {
        let cut = page::cut_out(&page, &proposal, k);
        let around = page::with_margin(&proposal.figures[k].place, page.dimensions());
        let middle = [200, 560][k] - around.left;
        let rim =
            (middle - 150..middle + 150).filter(|x| cut.get_pixel(*x, 81 - around.top).0[0] < 128);
        assert!(rim.count() > 290, "the rim of bowl {k} was rubbed out");
    }
}

#[test]
fn azimuths_by_hand_must_be_one_a_figure() {
    let azimuths = |text| page::azimuth_order(text).unwrap().unwrap();
    let mut proposals = vec![proposed(&sheet())];
    let wrong = page::set_azimuths(&mut proposals, &azimuths("0,90"));
    assert_eq!(wrong, Err(PageError::WrongNumber { found: 3, given: 2 }));
    let twice = page::set_azimuths(&mut proposals, &azimuths("0,90,360"));
    assert_eq!(twice, Err(PageError::DuplicateAzimuth(0.0)));
    page::set_azimuths(&mut proposals, &azimuths("0, 270 ,180")).unwrap();
    assert_eq!(proposals[0].figures[1].azimuth, Azimuth::from_degrees(270.0).unwrap());
    assert_eq!(page::azimuth_order("auto"), Ok(None));
    assert!(page::azimuth_order("0,x").is_err() && page::azimuth_order("").is_err());
}

#[test]
fn a_turn_of_pictures_is_in_even_steps() {
    let frame = |nose, face| {
        let mut page = paper(200, 260);
        figure(&mut page, 60, 30, nose, face);
        page
    };
    let frames = [frame(0, true), frame(1, true), frame(0, false), frame(-1, true)];
    let proposals = page::propose_turn(&frames, &PageOptions::default(), &Silent).unwrap();
    let azimuths: Vec<f64> = proposals.iter().flat_map(degrees).collect();
    assert_eq!(azimuths, [0.0, 270.0, 180.0, 90.0]);
    // Without a figure in one of them it is that one's fault.
    let [first, ..] = frames;
    let refused = page::propose_turn(&[first, paper(200, 260)], &PageOptions::default(), &Silent);
    assert!(matches!(refused, Err(PageError::InPicture { number: 1, .. })));
}

#[test]
fn pages_without_figures_are_refused() {
    let refused = |page: &RgbaImage| page::propose(page, &PageOptions::default(), &Silent).err();
    assert!(matches!(refused(&paper(300, 200)), Some(PageError::NoFigure { .. })));
    assert!(matches!(refused(&RgbaImage::new(0, 5)), Some(PageError::NoPixels { .. })));
    let few = PageOptions { max_figures: 2, ..PageOptions::default() };
    let many = page::propose(&sheet(), &few, &Silent).err();
    assert_eq!(many, Some(PageError::TooManyFigures { found: 3, limit: 2 }));
}

struct Impatient;

impl Observer for Impatient {
    fn progress(&self, _: Progress) {}

    fn is_cancelled(&self) -> bool {
        true
    }
}

#[test]
fn a_search_can_be_cancelled() {
    let stopped = page::propose(&sheet(), &PageOptions::default(), &Impatient).err();
    assert_eq!(stopped, Some(PageError::Cancelled));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Whatever is drawn, what is found lies on the page and is found again.
    #[test]
    fn any_page_is_searched(
        width in 1_u32..160,
        height in 1_u32..160,
        blocks in prop::collection::vec((0_u32..160, 0_u32..160, 1_u32..90, 1_u32..90, any::<[u8; 4]>()), 0..12),
        side in 64_u32..200,
    ) {
        let mut page = paper(width, height);
        for (x, y, w, h, colour) in blocks {
            block(&mut page, x, y, w, h, Rgba(colour));
        }
        let options = PageOptions { working_side_px: side, ..PageOptions::default() };
        let found = page::propose(&page, &options, &Silent);
        if let Ok(proposal) = &found {
            for (k, figure) in proposal.figures.iter().enumerate() {
                prop_assert!(figure.place.right <= width && figure.place.bottom <= height);
                prop_assert!(figure.place.width() > 0 && figure.place.height() > 0);
                prop_assert!((0.0..=1.0 + 1e-9).contains(&figure.confidence));
                page::cut_out(&page, proposal, k);
            }
            page::preview(&page, proposal);
        }
        let again = page::propose(&page, &options, &Silent);
        prop_assert_eq!(format!("{:?}", found), format!("{:?}", again));
    }
}

#[test]
fn specks_beside_a_figure_are_not_cut_out_with_it() {
    let mut page = paper(700, 400);
    figure(&mut page, 100, 100, 0, true);
    figure(&mut page, 380, 100, 0, false);
    block(&mut page, 150, 306, 2, 2, INK);
    let proposal = page::propose(&page, &PageOptions::default(), &Silent).unwrap();
    assert_eq!(proposal.figures.len(), 2);
    let bottom = proposal.figures[0].place.bottom;
    assert!(bottom <= 302, "the speck is no part of the figure: {bottom}");
    let cut = page::cut_out(&page, &proposal, 0);
    let from = page::with_margin(&proposal.figures[0].place, page.dimensions());
    let below = cut.enumerate_pixels().filter(|(_, y, _)| y + from.top > bottom);
    assert!(below.clone().count() > 500);
    assert!(below.into_iter().all(|(_, _, pixel)| pixel.0[0] > 200), "the speck was cut out");
    // The figure's own lines stay.
    assert!(cut.pixels().any(|pixel| *pixel == INK));
}
