//! Whether views fit better at other azimuths: left taken for right, two views
//! swapped, an angle misjudged.

use serde::Serialize;

use crate::align::profile::{Profile, Rows, mirrored};
use crate::align::section::unexplained;
use crate::align::{Alignment, View, axis};

/// When a hypothesis is named.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct HypothesisOptions {
    /// The disagreement must sink by at least this.
    pub least_margin: f64,
    /// The rows' middles must become likelier by at least this, natural logarithm.
    pub least_evidence: f64,
    /// The disagreement must sink to at most this share of what it is.
    pub most_remaining: f64,
    /// The farthest misjudged angle, degrees.
    pub max_angle_error_deg: f64,
    /// Angles are tried in steps of this, degrees.
    pub angle_step_deg: f64,
}

impl Default for HypothesisOptions {
    fn default() -> Self {
        Self {
            least_margin: 0.003,
            least_evidence: 4.0,
            most_remaining: 0.4,
            max_angle_error_deg: 16.0,
            angle_step_deg: 1.0,
        }
    }
}

/// What a view may be instead.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Suggestion {
    /// It shows the other side. An outline cannot tell this from a mirrored
    /// drawing.
    OtherSide {
        /// The view's azimuth as given, degrees.
        azimuth_deg: f64,
        /// The better one, degrees.
        better_deg: f64,
    },
    /// The drawing is mirrored.
    Mirrored {
        /// The view's azimuth as given, degrees.
        azimuth_deg: f64,
    },
    /// Two views are in each other's place.
    Swapped {
        /// Their azimuths as given, degrees.
        azimuths_deg: [f64; 2],
    },
    /// It is drawn at another angle.
    Angle {
        /// The view's azimuth as given, degrees.
        azimuth_deg: f64,
        /// The better one, degrees.
        better_deg: f64,
    },
}

impl std::fmt::Display for Suggestion {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::OtherSide { azimuth_deg, better_deg } => {
                write!(f, "view {azimuth_deg} fits better as {better_deg}")
            }
            Self::Mirrored { azimuth_deg } => write!(f, "view {azimuth_deg} looks mirrored"),
            Self::Swapped { azimuths_deg: [a, b] } => {
                write!(f, "views {a} and {b} fit better the other way round")
            }
            Self::Angle { azimuth_deg, better_deg } => {
                write!(f, "view {azimuth_deg} fits better at {better_deg}")
            }
        }
    }
}

/// A hypothesis and how well it does.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Verdict {
    /// What is suggested.
    pub suggestion: Suggestion,
    /// The disagreement that is left: share of the rows' widths that no common
    /// subject explains, with the shifts that this needs as shares of height.
    pub score: f64,
    /// By how much the disagreement sinks.
    pub margin: f64,
    /// How much likelier the rows' middles become, natural logarithm.
    pub evidence: f64,
}

/// What was found about the views' azimuths.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Hypotheses {
    /// The disagreement as given.
    pub score: f64,
    /// Better ones, best first; empty if the azimuths are plausible.
    pub suggestions: Vec<Verdict>,
    /// Azimuths of views of which outlines cannot tell left from right, degrees.
    pub undecidable_deg: Vec<f64>,
}

/// How far off axes usually are, share of height.
const USUAL_SHIFT: f64 = 0.012;
/// What such a shift adds to the disagreement.
const SHIFT_COST: f64 = 0.3;
/// So many sampled rows in turn err together.
const CORRELATED_ROWS: f64 = 5.0;

/// Rows and azimuths that are tried.
#[derive(Clone)]
struct Trial {
    azimuths_deg: Vec<f64>,
    rows: Vec<Rows>,
}

/// Tests the views' azimuths against each other by their outlines alone.
///
/// Every view's rows must be shadows of common sections that turn about one
/// axis. Each hypothesis may shift the views anew. Nothing is changed.
///
/// * `alignment`: of the same views, for their scales and rows.
pub fn hypotheses(
    views: &[View<'_>],
    alignment: &Alignment,
    options: &HypothesisOptions,
) -> Hypotheses {
    let height = (alignment.canvas.rows[1] - alignment.canvas.rows[0]).max(1.0);
    let rows = |(view, found): (&View<'_>, &crate::align::ViewAlignment)| {
        let profile = Profile::of(&view.subject.mask);
        let scale = found.transform.scale;
        profile.sampled(found.rows[0], height / scale, found.axis_x, scale)
    };
    let given = Trial {
        azimuths_deg: views.iter().map(|view| view.azimuth_deg).collect(),
        rows: views.iter().zip(&alignment.views).map(rows).collect(),
    };
    let (base, base_likelihood) = given.score(height);
    let mut tried: Vec<Verdict> = Vec::new();
    let mut undecidable_deg = Vec::new();
    let mut test = |suggestion: Suggestion, trial: Trial| {
        let (score, likelihood) = trial.score(height);
        let evidence = likelihood - base_likelihood;
        tried.push(Verdict { suggestion, score, margin: base - score, evidence });
        (score, evidence)
    };
    for k in 0..views.len() {
        let azimuth_deg = views[k].azimuth_deg;
        let side = azimuth_deg.rem_euclid(180.0);
        if side > 1.0 && side < 179.0 {
            let better_deg = (360.0 - azimuth_deg).rem_euclid(360.0);
            if !given.has(better_deg) {
                let other = given.at(k, better_deg);
                test(Suggestion::OtherSide { azimuth_deg, better_deg }, other);
            }
            let (score, evidence) = test(Suggestion::Mirrored { azimuth_deg }, given.mirrored(k));
            let told = (score - base).abs() >= options.least_margin
                || evidence.abs() >= options.least_evidence;
            if !told {
                undecidable_deg.push(azimuth_deg);
            }
        } else {
            test(Suggestion::Mirrored { azimuth_deg }, given.mirrored(k));
        }
        let steps = (options.max_angle_error_deg / options.angle_step_deg.max(0.1)) as i32;
        for step in (-steps..=steps).filter(|step| step.abs() > 3) {
            let better_deg =
                (azimuth_deg + f64::from(step) * options.angle_step_deg).rem_euclid(360.0);
            if !given.has(better_deg) {
                test(Suggestion::Angle { azimuth_deg, better_deg }, given.at(k, better_deg));
            }
        }
        for (j, other) in views.iter().enumerate().skip(k + 1) {
            let mut trial = given.clone();
            trial.azimuths_deg.swap(k, j);
            let azimuths_deg = [azimuth_deg, other.azimuth_deg];
            test(Suggestion::Swapped { azimuths_deg }, trial);
        }
    }
    tried.retain(|verdict| {
        verdict.margin >= options.least_margin
            && verdict.evidence >= options.least_evidence
            && verdict.score <= options.most_remaining * base
    });
    tried.sort_by(|a, b| a.score.total_cmp(&b.score));
    let limit = tried.first().map_or(0.0, |best| best.score + 0.25 * options.least_margin);
    // Of those that do as well the commonest mistake comes first: full profiles
    // are taken for each other more often than three-quarter views.
    let oblique = |s: &Suggestion| match s {
        Suggestion::OtherSide { azimuth_deg, .. } | Suggestion::Mirrored { azimuth_deg } => {
            azimuth_deg.to_radians().cos().abs()
        }
        _ => 0.0,
    };
    let rank = |s: &Suggestion| match s {
        Suggestion::OtherSide { .. } => 0,
        Suggestion::Swapped { .. } => 1,
        Suggestion::Mirrored { .. } => 2,
        Suggestion::Angle { .. } => 3,
    };
    tried.sort_by(|a, b| {
        let class = |v: &Verdict| if v.score <= limit { rank(&v.suggestion) } else { 9 };
        let order =
            |v: &Verdict| (class(v), if class(v) < 9 { oblique(&v.suggestion) } else { 0.0 });
        let ((a_class, a_side), (b_class, b_side)) = (order(a), order(b));
        a_class.cmp(&b_class).then(a_side.total_cmp(&b_side)).then(a.score.total_cmp(&b.score))
    });
    tried.truncate(5);
    Hypotheses { score: base, suggestions: tried, undecidable_deg }
}

impl Trial {
    fn has(&self, azimuth_deg: f64) -> bool {
        self.azimuths_deg.iter().any(|other| {
            let apart = (other - azimuth_deg).rem_euclid(360.0);
            !(0.5..=359.5).contains(&apart)
        })
    }

    fn at(&self, k: usize, azimuth_deg: f64) -> Self {
        let mut trial = self.clone();
        trial.azimuths_deg[k] = azimuth_deg;
        trial
    }

    fn mirrored(&self, k: usize) -> Self {
        let mut trial = self.clone();
        trial.rows[k] = mirrored(&trial.rows[k]);
        trial
    }

    /// How much the views disagree, and how likely their rows' middles are
    /// (logarithm, rows near each other counted once).
    fn score(&self, height: f64) -> (f64, f64) {
        let (shifts, likelihood) =
            axis::fitted(&self.azimuths_deg, &self.rows, USUAL_SHIFT * height);
        let missing = unexplained(&self.azimuths_deg, &self.rows, &shifts);
        let off = shifts.iter().map(|s| (s / height).powi(2)).sum::<f64>();
        let count = missing.len().max(1) as f64;
        let score = missing.iter().sum::<f64>() / count + SHIFT_COST * (off / count).sqrt();
        (score, likelihood / CORRELATED_ROWS)
    }
}
