//! Lists of azimuths as people write them.

use std::str::FromStr;

use super::Azimuth;

/// Azimuths as people write them: `0,45,90` or `0:90:5` (from, to,
/// step, both ends included), also mixed; sorted, each once.
///
/// ```
/// let list: frames::AzimuthList = "180,0:90:45".parse().unwrap();
/// let degrees: Vec<f64> = list.0.iter().map(|azimuth| azimuth.degrees()).collect();
/// assert_eq!(degrees, [0.0, 45.0, 90.0, 180.0]);
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct AzimuthList(pub Vec<Azimuth>);

/// More azimuths than any sheet has are a slip of the pen.
const MOST: usize = 3600;

impl FromStr for AzimuthList {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let mut azimuths = Vec::new();
        for part in text.split(',') {
            azimuths.extend(range(part.trim())?);
            if azimuths.len() > MOST {
                return Err(format!("more than {MOST} azimuths"));
            }
        }
        azimuths.sort();
        azimuths.dedup();
        Ok(Self(azimuths))
    }
}

fn range(text: &str) -> Result<Vec<Azimuth>, String> {
    let numbers = text
        .split(':')
        .map(|number| {
            number.trim().parse().map_err(|_| format!("{number:?} is no angle in degrees"))
        })
        .collect::<Result<Vec<f64>, _>>()?;
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

    fn degrees(text: &str) -> Vec<f64> {
        text.parse::<AzimuthList>().unwrap().0.iter().map(|a| a.degrees()).collect()
    }

    #[test]
    fn lists_and_ranges_mix() {
        assert_eq!(degrees("180,0:90:45"), [0.0, 45.0, 90.0, 180.0]);
        assert_eq!(degrees("0:0.3:0.1"), [0.0, 0.1, 0.2, 0.3]);
        assert_eq!(degrees("-45"), [315.0]);
    }

    #[test]
    fn one_angle_written_twice_counts_once() {
        assert_eq!(degrees("0,360,0:5:5"), [0.0, 5.0]);
    }

    #[test]
    fn nonsense_is_refused() {
        for text in ["", "a", "0:90", "0:90:0", "90:0:5", "nan", "0:inf:5", "0:1e9:0.001"] {
            assert!(text.parse::<AzimuthList>().is_err(), "{text}");
        }
    }
}
