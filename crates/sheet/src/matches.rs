//! Matches that a person corrected or made, by pair.

use nalgebra::Point2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use frames::Azimuth;

use super::PictureSize;

/// What coordinates of matches mean.
pub const MATCHES_FRAME: &str = "sheet pixels, x right, y down, pixel centres at half integers";

/// Each of a pair's lists holds no more matches than this.
const MAX_MATCHES: usize = 10_000;

/// The matches of one pair of neighbouring views, as the artifact
/// `pairs/{left}-{right}/matches.json` has them and as a sheet may bring them.
///
/// `matches` replace those found automatically; `remove` and `add` change them.
/// They are used from the epipolar stage on, by the method `uncalibrated`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PairMatchesDocument {
    /// Of the left view, degrees.
    pub left_azimuth_deg: f64,
    /// Of the right view, the next one counter-clockwise, degrees.
    pub right_azimuth_deg: f64,
    /// What the coordinates mean; if given, it must be what is served.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frame: Option<String>,
    /// Used instead of the automatic matches.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(length(max = 10_000))]
    pub matches: Option<Vec<MatchDocument>>,
    /// Used beside the automatic matches.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(length(max = 10_000))]
    pub add: Vec<MatchDocument>,
    /// Automatic matches that are dropped: those within half a pixel at both
    /// ends.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(length(max = 10_000))]
    pub remove: Vec<MatchDocument>,
}

/// One match: two places that show the same point of the subject.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MatchDocument {
    /// x and y in the left view, pixels.
    pub left: [f64; 2],
    /// x and y in the right view, pixels.
    pub right: [f64; 2],
    /// Descriptor distance; not read.
    #[serde(default)]
    pub distance: Option<f32>,
    /// Whether it agrees with the fundamental matrix; not read.
    #[serde(default)]
    pub inlier: Option<bool>,
}

/// A match in the sheet frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SheetMatch {
    /// The point in the left view, px.
    pub left: Point2<f64>,
    /// The same point of the subject in the right view, px.
    pub right: Point2<f64>,
}

/// What is done to a pair's automatic matches.
#[derive(Clone, Debug, PartialEq)]
pub enum MatchEdit {
    /// They are not used, these are.
    Replace(Vec<SheetMatch>),
    /// Some are dropped, others come to them.
    Change {
        /// Automatic matches to drop.
        remove: Vec<SheetMatch>,
        /// Matches that come to the rest.
        add: Vec<SheetMatch>,
    },
}

/// The checked matches of one pair of neighbours; `right` is ahead of `left`.
#[derive(Clone, Debug, PartialEq)]
pub struct PairEdit {
    /// The view that the pair turns from.
    pub left: Azimuth,
    /// Its neighbour, the next counter-clockwise.
    pub right: Azimuth,
    /// What to do to the pair's automatic matches.
    pub edit: MatchEdit,
}

/// Why given matches cannot be used. `place` is such as `matches[2].add[0]`.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MatchesProblem {
    /// A pair's angles are not finite.
    #[error("{place} names {left_deg} and {right_deg}; give finite angles in degrees")]
    InvalidAngle {
        /// Which entry.
        place: String,
        /// As given, degrees.
        left_deg: f64,
        /// As given, degrees.
        right_deg: f64,
    },
    /// The two views are no neighbours, or in the wrong order.
    #[error(
        "{place} is for views {left} and {right}, which are no neighbours in this order; the pairs are {pairs}"
    )]
    UnknownPair {
        /// Which entry.
        place: String,
        /// The left view as given.
        left: Azimuth,
        /// The right view as given.
        right: Azimuth,
        /// All pairs of neighbours, such as `0-45, 45-90`.
        pairs: String,
    },
    /// The two views are too far apart to be paired.
    #[error(
        "{place} is for views {left} and {right}, which are {angle_deg} degrees apart and not paired; max_pair_angle_deg is {limit_deg}"
    )]
    TooWide {
        /// Which entry.
        place: String,
        /// The left view.
        left: Azimuth,
        /// The right view.
        right: Azimuth,
        /// From left to right, degrees.
        angle_deg: f64,
        /// The widest that is paired, degrees.
        limit_deg: f64,
    },
    /// Two entries are for one pair.
    #[error("matches[{first}] and {place} are for the same pair; give each pair once")]
    DuplicatePair {
        /// The later entry.
        place: String,
        /// Index of the earlier one.
        first: usize,
    },
    /// An entry has no matches and changes nothing.
    #[error("{place} says nothing; give `matches`, or `add` and `remove`")]
    Empty {
        /// Which entry.
        place: String,
    },
    /// An entry both replaces all matches and changes some.
    #[error("{place} has both `matches` and `add` or `remove`; `matches` replace all others")]
    Contradictory {
        /// Which entry.
        place: String,
    },
    /// Coordinates are given in a frame that is not known.
    #[error("{place}.frame is {found:?}; coordinates are taken as {expected:?}")]
    UnknownFrame {
        /// Which entry.
        place: String,
        /// The frame it names, shortened.
        found: String,
        /// The one frame that is taken.
        expected: &'static str,
    },
    /// A list has too many matches.
    #[error("{place} has {found} matches, over the limit of {limit}")]
    TooMany {
        /// Which list.
        place: String,
        /// Matches that it has.
        found: usize,
        /// The most that are taken.
        limit: usize,
    },
    /// A point lies outside of its view or is not finite.
    #[error(
        "{place} is ({x}, {y}); give finite pixels within the view, 0 to {width} and 0 to {height}"
    )]
    OutsideView {
        /// Which point.
        place: String,
        /// As given, px right of the left edge.
        x: f64,
        /// As given, px below the top edge.
        y: f64,
        /// Of the view, px.
        width: u32,
        /// Of the view, px.
        height: u32,
    },
}

/// Checks the matches that a sheet brings.
///
/// * `views`: all of the sheet's, by rising azimuth, with their sizes.
/// * `max_pair_angle_deg`: views farther apart are not paired.
///
/// # Errors
/// [`MatchesProblem`], the first found.
pub fn check_matches(
    documents: &[PairMatchesDocument],
    views: &[(Azimuth, PictureSize)],
    max_pair_angle_deg: f64,
) -> Result<Vec<PairEdit>, MatchesProblem> {
    let mut edits: Vec<PairEdit> = Vec::new();
    for (index, document) in documents.iter().enumerate() {
        let place = format!("matches[{index}]");
        let pair = known_pair(document, views, &place, max_pair_angle_deg)?;
        let [(left, _), (right, _)] = pair;
        if let Some(first) = edits.iter().position(|e| (e.left, e.right) == (left, right)) {
            return Err(MatchesProblem::DuplicatePair { place, first });
        }
        let edit = edit(document, pair.map(|(_, size)| size), &place)?;
        edits.push(PairEdit { left, right, edit });
    }
    Ok(edits)
}

type SizedViews = [(Azimuth, PictureSize); 2];

fn known_pair(
    document: &PairMatchesDocument,
    views: &[(Azimuth, PictureSize)],
    place: &str,
    limit_deg: f64,
) -> Result<SizedViews, MatchesProblem> {
    let (left_deg, right_deg) = (document.left_azimuth_deg, document.right_azimuth_deg);
    let angles = (Azimuth::from_degrees(left_deg), Azimuth::from_degrees(right_deg));
    let (Ok(left), Ok(right)) = angles else {
        return Err(MatchesProblem::InvalidAngle { place: place.to_owned(), left_deg, right_deg });
    };
    let neighbours = (0..views.len()).filter(|_| views.len() > 1);
    let mut pairs = neighbours.map(|at| [views[at], views[(at + 1) % views.len()]]);
    let names: Vec<_> = pairs.clone().map(|[l, r]| format!("{}-{}", l.0, r.0)).collect();
    let found = pairs.find(|[(l, _), (r, _)]| (*l, *r) == (left, right));
    let Some(pair) = found else {
        let (place, pairs) = (place.to_owned(), names.join(", "));
        return Err(MatchesProblem::UnknownPair { place, left, right, pairs });
    };
    let angle_deg = left.degrees_to(right);
    if angle_deg > limit_deg {
        let place = place.to_owned();
        return Err(MatchesProblem::TooWide { place, left, right, angle_deg, limit_deg });
    }
    Ok(pair)
}

fn edit(
    document: &PairMatchesDocument,
    sizes: [PictureSize; 2],
    place: &str,
) -> Result<MatchEdit, MatchesProblem> {
    if let Some(frame) = document.frame.as_ref().filter(|frame| *frame != MATCHES_FRAME) {
        return Err(MatchesProblem::UnknownFrame {
            place: place.to_owned(),
            found: frame.chars().take(100).collect(),
            expected: MATCHES_FRAME,
        });
    }
    let changes = !(document.add.is_empty() && document.remove.is_empty());
    match &document.matches {
        Some(_) if changes => Err(MatchesProblem::Contradictory { place: place.to_owned() }),
        Some(all) => Ok(MatchEdit::Replace(placed(all, sizes, &format!("{place}.matches"))?)),
        None if changes => Ok(MatchEdit::Change {
            remove: placed(&document.remove, sizes, &format!("{place}.remove"))?,
            add: placed(&document.add, sizes, &format!("{place}.add"))?,
        }),
        None => Err(MatchesProblem::Empty { place: place.to_owned() }),
    }
}

fn placed(
    matches: &[MatchDocument],
    sizes: [PictureSize; 2],
    place: &str,
) -> Result<Vec<SheetMatch>, MatchesProblem> {
    if matches.len() > MAX_MATCHES {
        let (found, limit) = (matches.len(), MAX_MATCHES);
        return Err(MatchesProblem::TooMany { place: place.to_owned(), found, limit });
    }
    let point = |[x, y]: [f64; 2], size: PictureSize, place: &dyn Fn() -> String| {
        let PictureSize { width, height } = size;
        let inside =
            (0.0..=f64::from(width)).contains(&x) && (0.0..=f64::from(height)).contains(&y);
        if inside {
            return Ok(Point2::new(x, y));
        }
        Err(MatchesProblem::OutsideView { place: place(), x, y, width, height })
    };
    let both = matches.iter().enumerate().map(|(index, given)| {
        Ok(SheetMatch {
            left: point(given.left, sizes[0], &|| format!("{place}[{index}].left"))?,
            right: point(given.right, sizes[1], &|| format!("{place}[{index}].right"))?,
        })
    });
    both.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn views(degrees: &[f64]) -> Vec<(Azimuth, PictureSize)> {
        let size = PictureSize { width: 40, height: 30 };
        degrees.iter().map(|&a| (Azimuth::from_degrees(a).unwrap(), size)).collect()
    }

    fn check(documents: serde_json::Value) -> Result<Vec<PairEdit>, MatchesProblem> {
        let documents: Vec<PairMatchesDocument> = serde_json::from_value(documents).unwrap();
        check_matches(&documents, &views(&[0.0, 10.0, 20.0, 350.0]), 30.0)
    }

    fn problem(documents: serde_json::Value) -> String {
        check(documents).unwrap_err().to_string()
    }

    #[test]
    fn replaces_or_changes_the_matches_of_neighbours() {
        let given = json!({"left": [1.5, 2.5], "right": [40, 30]});
        let edits = check(json!([
            {"left_azimuth_deg": -10, "right_azimuth_deg": 360, "matches": [given]},
            {"left_azimuth_deg": 0, "right_azimuth_deg": 10, "frame": MATCHES_FRAME,
             "add": [given], "remove": [given]},
        ]))
        .unwrap();
        let expected = SheetMatch { left: Point2::new(1.5, 2.5), right: Point2::new(40.0, 30.0) };
        assert_eq!(edits[0].edit, MatchEdit::Replace(vec![expected]));
        assert_eq!(edits[0].left.degrees(), 350.0);
        let change = MatchEdit::Change { remove: vec![expected], add: vec![expected] };
        assert_eq!(edits[1].edit, change);
    }

    #[test]
    fn no_match_at_all_may_be_asked_for() {
        let edits = check(json!([{"left_azimuth_deg": 0, "right_azimuth_deg": 10, "matches": []}]));
        assert_eq!(edits.unwrap()[0].edit, MatchEdit::Replace(Vec::new()));
    }

    #[test]
    fn says_what_is_wrong_with_a_pair() {
        let pair = |left: f64, right: f64| json!([{"left_azimuth_deg": left, "right_azimuth_deg": right, "matches": []}]);
        let text = problem(pair(10.0, 0.0));
        assert!(text.contains("0-10, 10-20, 20-350, 350-0"), "{text}");
        assert!(problem(pair(0.0, 20.0)).contains("no neighbours"));
        assert!(problem(pair(0.0, 15.0)).contains("15"));
        assert!(problem(pair(20.0, 350.0)).contains("max_pair_angle_deg is 30"));
        let twice = [pair(0.0, 10.0)[0].clone(), pair(360.0, 10.0)[0].clone()];
        assert!(problem(json!(twice)).contains("matches[0] and matches[1]"));
    }

    #[test]
    fn says_what_is_wrong_with_its_lists() {
        let with = |extra: serde_json::Value| {
            let mut pair = json!({"left_azimuth_deg": 0, "right_azimuth_deg": 10});
            pair.as_object_mut().unwrap().extend(extra.as_object().unwrap().clone());
            problem(json!([pair]))
        };
        let given = json!({"left": [1, 2], "right": [3, 4]});
        assert!(with(json!({})).contains("says nothing"));
        assert!(with(json!({"matches": [], "add": [given]})).contains("both"));
        assert!(with(json!({"matches": [], "frame": "metres"})).contains("metres"));
        let outside = json!({"left": [1, 2], "right": [40.5, 4]});
        let text = with(json!({"add": [given, outside]}));
        assert!(text.contains("matches[0].add[1].right") && text.contains("0 to 40"), "{text}");
        let negative = json!({"left": [1, -0.1], "right": [4, 4]});
        assert!(with(json!({"remove": [negative]})).contains("matches[0].remove[0].left"));
        let many = vec![given; MAX_MATCHES + 1];
        assert!(with(json!({"matches": many})).contains("10001 matches"));
    }

    #[test]
    fn what_is_not_a_number_is_outside() {
        let given = MatchDocument {
            left: [f64::NAN, 1.0],
            right: [1.0, 1.0],
            distance: None,
            inlier: None,
        };
        let document = PairMatchesDocument {
            right_azimuth_deg: 10.0,
            add: vec![given],
            ..PairMatchesDocument::default()
        };
        let found = check_matches(&[document], &views(&[0.0, 10.0]), 30.0);
        assert!(matches!(found, Err(MatchesProblem::OutsideView { .. })), "{found:?}");
    }
}
