//! Whole reconstructions of a small wire model.

use image::{GrayImage, Luma};
use imageproc::drawing::draw_line_segment_mut;
use proptest::prelude::*;
use serde_json::{Value, json};

use super::*;
use crate::Options;
use frames::Azimuth;
use progress::Silent;
use sheet::{MatchDocument, PairMatchesDocument, Sheet, View};

const WIDTH: u32 = 200;
const HEIGHT: u32 = 150;

/// Edges of boxes of these half sizes about these centres, in px.
fn edges() -> Vec<[[f64; 3]; 2]> {
    let boxes = [
        ([60.0, 40.0, 20.0], [0.0, 0.0, -45.0], 10.0),
        ([35.0, 45.0, 18.0], [12.0, -5.0, -5.0], 35.0),
        ([22.0, 18.0, 22.0], [-10.0, 10.0, 40.0], -20.0),
    ];
    let corner = |(half, centre, turn): ([f64; 3], [f64; 3], f64), i: usize| {
        let (sin, cos) = f64::to_radians(turn).sin_cos();
        let at =
            |axis: usize| centre[axis] + if i >> axis & 1 == 1 { half[axis] } else { -half[axis] };
        let (x, y) = (at(0), at(1));
        [x * cos - y * sin, x * sin + y * cos, at(2)]
    };
    let of_box = |shape| {
        let ends = (0..8_usize).flat_map(|i| [1, 2, 4].map(|bit| (i, i | bit)));
        ends.filter(|(a, b)| a != b).map(move |(a, b)| [corner(shape, a), corner(shape, b)])
    };
    boxes.into_iter().flat_map(of_box).collect()
}

fn drawing(azimuth_deg: f64) -> GrayImage {
    let (sin, cos) = azimuth_deg.to_radians().sin_cos();
    let project = |p: [f64; 3]| {
        let x = p[0] * cos + p[1] * sin + f64::from(WIDTH) / 2.0;
        (x as f32, (f64::from(HEIGHT) / 2.0 - p[2]) as f32)
    };
    let mut image = GrayImage::from_pixel(WIDTH, HEIGHT, Luma([255]));
    for [a, b] in edges() {
        let ((ax, ay), (bx, by)) = (project(a), project(b));
        for shift in [0.0, 1.0] {
            draw_line_segment_mut(&mut image, (ax + shift, ay), (bx + shift, by), Luma([0]));
            draw_line_segment_mut(&mut image, (ax, ay + shift), (bx, by + shift), Luma([0]));
        }
    }
    image
}

fn sheet() -> Sheet {
    let view =
        |degrees: f64| View::level(Azimuth::from_degrees(degrees).unwrap(), drawing(degrees), None);
    Sheet::new(vec![view(0.0), view(5.0), view(10.0)]).unwrap()
}

fn options(over: Value) -> Options {
    let mut all = json!({
        "disparity": {"block_size": 9, "min_disparity_px": -16},
        "merge": {"iterations": 40},
    });
    ::options::merge(&mut all, over);
    ::options::parse_set(&all).unwrap()
}

fn run(sheet: &Sheet, over: Value) -> (Reconstruction, Metrics) {
    let done = reconstruct(sheet, &options(over), 2, &Silent).unwrap();
    let metrics = measure(&done, WIDTH, HEIGHT);
    (done, metrics)
}

/// A pair's matches as they are served.
fn served(pair: &PairResult) -> Vec<MatchDocument> {
    let inliers = pair.geometry().unwrap().inliers.iter();
    let entry = |(found, inlier): (&MatchedPoints, &bool)| MatchDocument {
        left: [found.points.left.x + 0.5, found.points.left.y + 0.5],
        right: [found.points.right.x + 0.5, found.points.right.y + 0.5],
        distance: found.distance,
        inlier: Some(*inlier),
    };
    pair.matches.iter().zip(inliers).map(entry).collect()
}

fn first_pair() -> PairMatchesDocument {
    PairMatchesDocument { right_azimuth_deg: 5.0, ..PairMatchesDocument::default() }
}

#[test]
fn served_matches_come_back_as_they_are_and_corrected() {
    let (automatic, before) = run(&sheet(), json!({}));
    assert!(before.pairs[0].usable && before.pairs[0].corrected_matches.is_none());
    let all = served(&automatic.pairs[0]);

    let replaced = PairMatchesDocument { matches: Some(all.clone()), ..first_pair() };
    let (again, after) = run(&sheet().with_matches(&[replaced], 30.0).unwrap(), json!({}));
    let given = all.len();
    assert_eq!(after.pairs[0].corrected_matches, Some(EditReport::Replaced { given }));
    assert_eq!(again.pairs[0].geometry(), automatic.pairs[0].geometry());
    assert_eq!(again.pairs[1].matches, automatic.pairs[1].matches);

    // Without its outliers and its first match, and with that one given again.
    let (kept, mut remove): (Vec<_>, Vec<_>) =
        all.into_iter().partition(|found| found.inlier == Some(true));
    remove.push(kept[0].clone());
    let removed = remove.len();
    let changed = PairMatchesDocument { remove, add: vec![kept[0].clone()], ..first_pair() };
    let (third, metrics) = run(&sheet().with_matches(&[changed], 30.0).unwrap(), json!({}));
    let expected = EditReport::Changed { removed, not_found: 0, added: 1 };
    assert_eq!(metrics.pairs[0].corrected_matches, Some(expected));
    assert_eq!(metrics.pairs[0].outlier_ratio, Some(0.0));
    assert_eq!(third.pairs[0].matches.last().unwrap().distance, None);
}

#[test]
fn given_matches_alone_take_a_blank_pair_to_the_end() {
    let known = sheet();
    let mut views = known.views().to_vec();
    let (automatic, _) = run(&known, json!({}));
    let matches = Some(served(&automatic.pairs[0]));
    // Nothing to detect in any view but the last two.
    views[0].image = GrayImage::from_pixel(WIDTH, HEIGHT, Luma([255]));
    let given = PairMatchesDocument { matches, ..first_pair() };
    let blank = Sheet::new(views).unwrap().with_matches(&[given], 30.0).unwrap();
    let (done, metrics) = run(&blank, json!({"epipolar": {"tries": 4}}));
    assert!(metrics.pairs[0].usable);
    assert_eq!((metrics.pairs[0].keypoints_left, metrics.pairs[0].tries.len()), (0, 1));
    assert_eq!(done.pairs[0].geometry(), automatic.pairs[0].geometry());
}

#[test]
fn optimising_five_metrics_reports_every_try_and_keeps_the_cheapest() {
    let five = json!({"epipolar": {"feedback": "five_metrics", "tries": 6}, "seed": 4});
    let (_, metrics) = run(&sheet(), five.clone());
    for pair in &metrics.pairs {
        assert_eq!(pair.tries.len(), 6);
        let chosen = &pair.tries[pair.chosen_try as usize - 1];
        assert_eq!(chosen.number, pair.chosen_try);
        // Those with few inliers come last.
        let rank = |attempt: &TryReport| (attempt.inliers < 15, attempt.cost.unwrap());
        let ranks = pair.tries.iter().filter(|attempt| attempt.cost.is_some()).map(rank);
        let least = ranks.min_by(|one, other| one.partial_cmp(other).unwrap()).unwrap();
        assert_eq!(rank(chosen), least);
        assert_eq!(pair.mean_sampson_inliers.map(|m| m.px2), chosen.mean_sampson_px2);
        assert!(pair.tries.iter().any(|attempt| attempt.max_error_px != 2.0));
    }
    assert_eq!(run(&sheet(), five).1, metrics);
    let other = json!({"epipolar": {"feedback": "five_metrics", "tries": 6}, "seed": 5});
    assert_ne!(run(&sheet(), other).1.pairs[0].tries, metrics.pairs[0].tries);
}

#[test]
fn clouds_of_corners_hold_the_matches_alone() {
    let corners = json!({"cloud": {"source": "corners", "depth": "affine"}});
    let (done, _) = run(&sheet(), corners);
    let (dense, _) = run(&sheet(), json!({"cloud": {"depth": "affine"}}));
    let bits = |done: &Reconstruction| -> Vec<u32> {
        done.views[1].depth.as_ref().unwrap().iter().map(|value| value.to_bits()).collect()
    };
    assert!(bits(&done) == bits(&dense));
    let matches: usize = done.pairs.iter().map(|pair| 2 * pair.inliers().len()).sum();
    let points = done.cloud(1).count();
    assert!((12..=matches).contains(&points), "{points} of {matches}");
    assert!(dense.cloud(1).count() > 50 * points);
    let hull = done.hull.unwrap();
    assert!(hull.signed_volume() > 0.0);
}

/// Each detector and descriptor that go together, and each way of matching and
/// estimating.
#[test]
fn every_path_of_the_options_gives_reports() {
    let (detectors, descriptors) =
        (["fast", "orb", "harris", "shi_tomasi", "sift", "surf"], ["orb", "sift", "surf"]);
    let detection = detectors.iter().flat_map(|detector| {
        descriptors.map(|descriptor| {
            json!({"detection": {"detector": detector, "descriptor": descriptor,
                "orb": {"edge_threshold_px": 20}, "surf": {"hessian_threshold": 100}}})
        })
    });
    let estimators = ["ransac", "eight_point_ransac", "lmeds", "eight_point"]
        .map(|estimator| json!({"epipolar": {"estimator": estimator}}));
    let matching = [json!({"matcher": "flann"}), json!({"matcher": "flann", "ratio": 0.9})]
        .map(|matching| json!({ "matching": matching }));
    for over in detection.chain(estimators).chain(matching) {
        let refused =
            over["detection"]["detector"] == "sift" && over["detection"]["descriptor"] == "orb";
        if refused {
            assert!(::options::parse_set::<Options>(&over).is_err());
            continue;
        }
        match reconstruct(&sheet(), &options(over.clone()), 2, &Silent) {
            Ok(done) => {
                let metrics = measure(&done, WIDTH, HEIGHT);
                let usable = metrics.pairs.iter().filter(|pair| pair.usable);
                for pair in usable {
                    let sampson = pair.mean_sampson_inliers.unwrap().px2;
                    let reprojection = pair.reprojection_inliers.unwrap().px2;
                    let symmetric = pair.symmetric_epipolar_inliers.unwrap().px2;
                    let near = (sampson - reprojection).abs() <= 0.05 * sampson + 1e-9;
                    assert!(near || sampson > 1.0, "{over}: {sampson}, {reprojection}");
                    assert!(symmetric >= 2.0 * sampson, "{over}: {sampson}, {symmetric}");
                }
            }
            Err(error) => assert_eq!(error.code(), "no_usable_pair", "{over}"),
        }
    }
}

/// All that goes into artifacts, bit by bit.
fn everything(sheet: &Sheet, options: &Options, threads: usize) -> Vec<u8> {
    let done = reconstruct(sheet, options, threads, &Silent).unwrap();
    let metrics = measure(&done, WIDTH, HEIGHT);
    let mut bytes = serde_json::to_vec(&metrics).unwrap();
    for view in &done.views {
        let maps = [&view.disparity, &view.depth].into_iter().flatten();
        bytes.extend(maps.flat_map(|map| map.iter()).flat_map(|value| value.to_le_bytes()));
    }
    for pair in &done.pairs {
        bytes.extend(serde_json::to_vec(&served(pair)).unwrap());
    }
    let corners = done.hull.unwrap().positions;
    bytes.extend(corners.iter().flat_map(|p| [p.x, p.y, p.z]).flat_map(f64::to_le_bytes));
    bytes
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4))]

    #[test]
    fn neither_the_views_order_nor_threads_change_a_bit(
        order in Just(vec![0_usize, 1, 2]).prop_shuffle(),
        threads in 2_usize..5,
        seed in 0_u32..1000,
        matcher in prop_oneof!["brute_force", "flann"],
        tries in 1_u32..3,
    ) {
        let options = options(json!({
            "seed": seed,
            "matching": {"matcher": matcher},
            "epipolar": {"feedback": "five_metrics", "tries": tries,
                "estimator": "eight_point_ransac"},
            "disparity": {"block_sizes": [5, 9]},
        }));
        let views = sheet().views().to_vec();
        let permuted = Sheet::new(order.iter().map(|&at| views[at].clone()).collect()).unwrap();
        let first = everything(&sheet(), &options, 1);
        prop_assert!(first == everything(&permuted, &options, threads));
    }
}
