//! The paths of inputs and artifacts, made from names that are not trusted.

use object_store::path::{Path, PathPart};

use crate::{JobId, TenantName};

/// File systems allow 255 bytes a name; some stay free for temporary suffixes.
const MAX_SEGMENT_BYTES: usize = 200;
const MAX_SEGMENTS: usize = 8;

pub(super) const INPUTS: &str = "inputs";
pub(super) const ARTIFACTS: &str = "artifacts";
pub(super) const TENANTS: &str = "tenants";

/// Where the bytes of a job or page lie in a store.
#[derive(Clone, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum Home {
    /// Beside those of all tenants.
    #[default]
    Shared,
    /// Below their tenant's prefix.
    Tenant(TenantName),
}

impl Home {
    /// What the paths of keys are below. Names of tenants are plain lower-case words.
    pub(super) fn prefix(&self) -> Path {
        match self {
            Self::Shared => Path::default(),
            Self::Tenant(name) => Path::from_iter([TENANTS, name.as_str()]),
        }
    }
}

/// A job or page and where its bytes lie.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BytesOf {
    /// Its name.
    pub id: JobId,
    /// Where they lie.
    pub home: Home,
}

/// Where bytes are stored; every path is made here.
///
/// Names are relative paths such as `views/22.5/disparity.png`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Key<'a> {
    /// An uploaded file of a job, or a file of a page.
    Input {
        /// The job or page that it belongs to.
        job: JobId,
        /// Its name among the job's inputs.
        name: &'a str,
    },
    /// An artifact that one attempt of a job wrote.
    Artifact {
        /// The job that made it.
        job: JobId,
        /// The attempt that wrote it, from 1.
        attempt: u32,
        /// Its name among the attempt's artifacts.
        name: &'a str,
    },
}

/// Why a name can't be stored.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{name:?} can't be stored under this name: {reason}")]
pub struct InvalidName {
    /// The name that was refused.
    pub name: String,
    /// What is wrong with it, as the end of a sentence.
    pub reason: &'static str,
}

impl Key<'_> {
    /// The path in the store. It lies below the job's own folder whatever the
    /// name; characters that some store does not take are percent-encoded.
    ///
    /// # Errors
    /// [`InvalidName`] if the name is empty, absolute, steps upwards, has control
    /// characters or is too long.
    pub fn path(&self) -> Result<Path, InvalidName> {
        let (folder, name) = match self {
            Self::Input { job, name } => (inputs_of(*job), name),
            Self::Artifact { job, attempt, name } => (attempt_of(*job, *attempt), name),
        };
        let segments =
            segments(name).map_err(|reason| InvalidName { name: (*name).to_owned(), reason })?;
        Ok(folder.parts().chain(segments).collect())
    }
}

fn segments(name: &str) -> Result<Vec<PathPart<'_>>, &'static str> {
    let mut parts = Vec::new();
    for segment in name.split('/') {
        let part = PathPart::from(segment);
        if segment.is_empty() {
            return Err("a part of it is empty");
        } else if segment == "." || segment == ".." {
            return Err("a part of it is a dot segment");
        } else if segment.chars().any(|c| c.is_control() || c == '\\') {
            return Err("it has control characters or backslashes");
        } else if part.as_ref().len() > MAX_SEGMENT_BYTES || parts.len() == MAX_SEGMENTS {
            return Err("it is too long");
        }
        parts.push(part);
    }
    Ok(parts)
}

/// The folder of a job's inputs.
pub(super) fn inputs_of(job: JobId) -> Path {
    Path::from_iter([INPUTS, &job.to_string()])
}

/// The folder of all attempts of a job.
pub(super) fn attempts_of(job: JobId) -> Path {
    Path::from_iter([ARTIFACTS, &job.to_string()])
}

/// The folder of one attempt.
pub(super) fn attempt_of(job: JobId, attempt: u32) -> Path {
    Path::from_iter([ARTIFACTS, &job.to_string(), &attempt.to_string()])
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn job() -> JobId {
        "0191d6c1-7b1a-7c3e-8f00-0123456789ab".parse().unwrap()
    }

    #[test]
    fn names_are_kept_below_job_and_attempt() {
        let key = Key::Artifact { job: job(), attempt: 3, name: "views/22.5/disparity.png" };
        assert_eq!(
            key.path().unwrap().as_ref(),
            "artifacts/0191d6c1-7b1a-7c3e-8f00-0123456789ab/3/views/22.5/disparity.png"
        );
        let key = Key::Input { job: job(), name: "front 1#2.png" };
        assert_eq!(
            key.path().unwrap().as_ref(),
            "inputs/0191d6c1-7b1a-7c3e-8f00-0123456789ab/front 1%232.png"
        );
    }

    #[test]
    fn names_that_step_out_are_refused() {
        let long = "x".repeat(201);
        let deep = "a/".repeat(8) + "a";
        let names = ["", "/", "/etc/passwd", "..", "../x", "a/../b", "a//b", "a/.", "a\\b", "a\0b"];
        for name in names.into_iter().chain([long.as_str(), deep.as_str()]) {
            let error = Key::Input { job: job(), name }.path().unwrap_err();
            assert_eq!(error.name, name);
        }
    }

    proptest! {
        #[test]
        fn any_accepted_name_stays_in_its_folder_and_is_its_own(a in ".{0,40}", b in ".{0,40}") {
            let path = |name| Key::Input { job: job(), name }.path();
            if let Ok(stored) = path(&a) {
                prop_assert!(stored.prefix_matches(&inputs_of(job())));
                prop_assert!(stored.parts().all(|part| part.as_ref() != ".."));
                if let Ok(other) = path(&b) {
                    prop_assert_eq!(a == b, stored == other);
                }
            }
        }
    }
}
