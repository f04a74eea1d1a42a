//! Lists of viewpoints as people write them.

use std::str::FromStr;

use super::{Azimuth, Elevation, Viewpoint};

/// Views as people write them: azimuths like `0,45,90` or `0:90:5` (from, to, step, both ends
/// included), also mixed, each with its elevation behind an @ if it is not the usual one:
/// `0,90,0@90`, `0:315:45@30`; sorted, each once.
///
/// ```
/// use frames::{Elevation, ViewpointList};
///
/// let list: ViewpointList = "180,0:90:45,0@90".parse().unwrap();
/// let names: Vec<String> = list.at(Elevation::LEVEL).iter().map(|v| v.to_string()).collect();
/// assert_eq!(names, ["0", "0_e90", "45", "90", "180"]);
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct ViewpointList(Vec<(Azimuth, Option<Elevation>)>);

/// More views than any sheet has are a slip of the pen.
const MOST: usize = 3600;

impl ViewpointList {
    /// The viewpoints, `usual` being the elevation of those that say none.
    pub fn at(&self, usual: Elevation) -> Vec<Viewpoint> {
        let place = |&(azimuth, elevation): &(Azimuth, Option<Elevation>)| Viewpoint {
            azimuth,
            elevation: elevation.unwrap_or(usual),
        };
        let mut viewpoints: Vec<Viewpoint> = self.0.iter().map(place).collect();
        viewpoints.sort();
        viewpoints.dedup();
        viewpoints
    }
}

impl FromStr for ViewpointList {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let mut views = Vec::new();
        for part in text.split(',') {
            let (azimuths, elevation) = match part.split_once('@') {
                None => (part, None),
                Some((azimuths, elevation)) => (azimuths, Some(self::elevation(elevation)?)),
            };
            views.extend(range(azimuths.trim())?.into_iter().map(|azimuth| (azimuth, elevation)));
            if views.len() > MOST {
                return Err(format!("more than {MOST} views"));
            }
        }
        views.sort();
        views.dedup();
        Ok(Self(views))
    }
}

fn elevation(text: &str) -> Result<Elevation, String> {
    let degrees = number(text)?;
    Elevation::from_degrees(degrees).map_err(|error| error.to_string())
}

fn number(text: &str) -> Result<f64, String> {
    text.trim().parse().map_err(|_| format!("{text:?} is no angle in degrees"))
}

fn range(text: &str) -> Result<Vec<Azimuth>, String> {
    let numbers = text.split(':').map(number).collect::<Result<Vec<f64>, _>>()?;
    if numbers.iter().any(|number| !number.is_finite()) {
        return Err(format!("{text:?} has an angle that is not finite"));
    }
    let azimuth = |degrees| Azimuth::from_degrees(degrees).map_err(|error| error.to_string());
    match numbers[..] {
        [degrees] => Ok(vec![azimuth(degrees)?]),
        [from, to, step] if step > 0.0 && from <= to => {
            let steps = ((to - from) / step + 1e-9).floor();
            if steps > MOST as f64 {
                return Err(format!("{text:?} is more than {MOST} azimuths"));
            }
            (0..=steps as u32).map(|i| azimuth(from + f64::from(i) * step)).collect()
        }
        _ => Err(format!("{text:?} is neither an angle nor FROM:TO:STEP")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(text: &str) -> Vec<String> {
        let list = text.parse::<ViewpointList>().unwrap();
        list.at(Elevation::LEVEL).iter().map(ToString::to_string).collect()
    }

    #[test]
    fn lists_and_ranges_mix() {
        assert_eq!(names("180,0:90:45"), ["0", "45", "90", "180"]);
        assert_eq!(names("0:0.3:0.1"), ["0", "0.1", "0.2", "0.3"]);
        assert_eq!(names("-45"), ["315"]);
    }

    #[test]
    fn one_view_written_twice_counts_once() {
        assert_eq!(names("0,360,0:5:5,0@0"), ["0", "5"]);
    }

    #[test]
    fn elevations_stand_behind_the_azimuth() {
        assert_eq!(names("0, 90,0@-30 ,0:90:90@ 30"), ["0_e-30", "0", "0_e30", "90", "90_e30"]);
        let list: ViewpointList = "0,0@0".parse().unwrap();
        let usual = Elevation::from_degrees(20.0).unwrap();
        let names: Vec<String> = list.at(usual).iter().map(ToString::to_string).collect();
        assert_eq!(names, ["0", "0_e20"]);
    }

    #[test]
    fn nonsense_is_refused() {
        for text in [
            "",
            "a",
            "0:90",
            "0:90:0",
            "90:0:5",
            "nan",
            "0:inf:5",
            "0:1e9:0.001",
            "0@",
            "0@91",
            "0@nan",
            "@30",
            "0@1@2",
        ] {
            assert!(text.parse::<ViewpointList>().is_err(), "{text}");
        }
    }
}
