//! Why jobs fail: every kind, with what it means and how to mend it.

use std::fmt;

/// Makes the enum, its names and its texts from one table.
macro_rules! failure_codes {
    ($($id:ident = $name:literal, $meaning:literal, $remedy:literal;)*) => {
        /// A kind of failure of a job; its name is stable and part of the API.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        pub enum FailureCode {
            $(#[doc = $meaning] $id,)*
        }

        impl FailureCode {
            /// Every kind, in the order of the documentation.
            pub const ALL: &[Self] = &[$(Self::$id),*];

            /// The name that the API gives.
            pub fn name(self) -> &'static str {
                match self { $(Self::$id => $name,)* }
            }

            /// What it means.
            pub fn meaning(self) -> &'static str {
                match self { $(Self::$id => $meaning,)* }
            }

            /// How to mend it.
            pub fn remedy(self) -> &'static str {
                match self { $(Self::$id => $remedy,)* }
            }
        }
    };
}

failure_codes! {
    InvalidOptions = "invalid_options", "The stored options are not accepted by this version.",
        "send the sheet again; /v1/options lists what is taken";
    InvalidAzimuth = "invalid_azimuth", "An azimuth is not a finite number of degrees.",
        "write angles as decimal degrees";
    InvalidImage = "invalid_image", "A drawing or mask cannot be decoded.", "export it again";
    InvalidSheet = "invalid_sheet", "The views do not make a sheet.",
        "give each angle once, and masks of their drawings' sizes";
    InvalidMatches = "invalid_matches", "Matches do not fit the sheet.",
        "give matches of neighbouring views, within the drawings";
    InvalidViews = "invalid_views", "The views cannot be used together.",
        "make all views one size, at different angles";
    InvalidTruth = "invalid_truth", "The ground truth cannot be used.",
        "check its files, sizes and scale";
    TooFewViews = "too_few_views", "The sheet has fewer level views than the method takes.",
        "add level views, or choose a method that takes fewer";
    SizesDiffer = "sizes_differ", "The views differ in size.", "make all views one size";
    TooLarge = "too_large", "Views and options need more memory than a job may take.",
        "use smaller views, fewer disparities, or another mode or detector";
    ElevationUnsupported = "elevation_unsupported",
        "A view is drawn from above or below, and the method takes level views.",
        "leave it out, or use the method turntable";
    BlankView = "blank_view", "Nothing is drawn in a view.",
        "draw dark lines on light paper, give a mask, or leave the view out";
    NoPaper = "no_paper", "No paper is left around the subject.",
        "leave a margin around the subject, or give its mask";
    NoCommonRow = "no_common_row", "The silhouettes have no row in common.",
        "draw all views at one height and one scale";
    ContradictingViews = "contradicting_views", "Nothing is inside all silhouettes.",
        "check the views' angles and that all show one subject";
    NoUsablePair = "no_usable_pair", "No pair of neighbouring views could be used.",
        "draw views at most max_pair_angle_deg apart, with more corners in common";
    InvalidModel = "invalid_model", "The model cannot be read.", "export it again";
    NoTriangles = "no_triangles", "The model has no triangle with an area.",
        "export it with its faces";
    TooManySamples = "too_many_samples", "Size and supersampling ask for too many samples.",
        "draw smaller views or fewer samples";
    TooManyPixels = "too_many_pixels", "The views have too many pixels together.",
        "draw fewer or smaller views";
    CameraInsideModel = "camera_inside_model", "The model reaches beyond the camera.",
        "scale it, move the camera back, or let it be fitted";
    TooComplex = "too_complex", "The model's triangles hide each other too often.",
        "decimate the model";
    NoViews = "no_views", "No view is asked for.", "give at least one azimuth";
    TooManyViews = "too_many_views", "Too many views are asked for.", "leave some out";
    DuplicateView = "duplicate_view", "A view is asked for twice.", "give each direction once";
    TimeLimit = "time_limit", "The job took longer than a job may.",
        "use smaller or fewer views, or cheaper options";
    EnvironmentTrouble = "environment_trouble",
        "For an hour the service could not read or write what the job needs.",
        "tell who runs the service, then send it again";
    Unreadable = "unreadable", "The stored job cannot be read.", "send it again";
    AttemptsExhausted = "attempts_exhausted", "Every attempt at the job broke off.",
        "send it again; if it fails again, report it";
    Crashed = "crashed", "The job's process died at every attempt, of what it met or of too much memory.",
        "send it with smaller or fewer views; if it crashes again, report it";
    LeaseExpired = "lease_expired", "The job's worker was lost.", "send it again";
    Internal = "internal", "Something broke that is not the input's fault.",
        "send it again; if it fails again, report it";
}

impl fmt::Display for FailureCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl From<&drawing::DrawError> for FailureCode {
    fn from(error: &drawing::DrawError) -> Self {
        use drawing::DrawError as Found;
        match error {
            Found::NoTriangles => Self::NoTriangles,
            Found::InvalidModel { .. } => Self::InvalidModel,
            Found::Options(_) => Self::InvalidOptions,
            Found::TooManySamples { .. } => Self::TooManySamples,
            Found::TooManyPixels { .. } => Self::TooManyPixels,
            Found::CameraInsideModel { .. } => Self::CameraInsideModel,
            Found::TooComplex { .. } => Self::TooComplex,
            Found::NoViews => Self::NoViews,
            Found::TooManyViews { .. } => Self::TooManyViews,
            Found::DuplicateView { .. } => Self::DuplicateView,
            Found::Cancelled(_) | Found::Encoding { .. } => Self::Internal,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_unique_and_the_queue_s_own_are_among_them() {
        let names: Vec<_> = FailureCode::ALL.iter().map(|code| code.name()).collect();
        let unique: std::collections::BTreeSet<_> = names.iter().collect();
        assert_eq!(unique.len(), names.len());
        for own in [jobs::ATTEMPTS_EXHAUSTED, jobs::CRASHED, jobs::LEASE_EXPIRED, jobs::UNREADABLE]
        {
            assert!(names.contains(&own), "{own}");
        }
    }
}
