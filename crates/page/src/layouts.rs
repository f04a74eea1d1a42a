//! Usual orders of the views on a page.

/// Azimuths in reading order, and how usual that order is.
#[derive(Clone, Debug)]
pub(crate) struct Layout {
    pub(crate) azimuths: Vec<f64>,
    /// Logarithm of its share, up to a constant.
    pub(crate) prior: f64,
}

/// What turning the other way costs, and reading from right to left.
const OTHER_WAY: f64 = -0.1;
const REVERSED: f64 = -6.0;
/// What beginning a full turn elsewhere than at the front costs.
const LATER_START: f64 = -8.0;
/// What full turns of steps other than 45 and 90 degrees cost on a page.
const ODD_STEP: f64 = -6.0;

/// Orders for `count` views, those in which the side faces left.
fn usual(count: usize) -> &'static [(&'static [i32], f64)] {
    match count {
        1 => &[(&[0], 0.0), (&[45], -2.0), (&[90], -2.0), (&[180], -4.0)],
        2 => &[(&[0, 90], 0.0), (&[0, 180], -0.3), (&[0, 45], -3.0), (&[45, 225], -3.5)],
        3 => &[
            (&[0, 90, 180], 0.0),
            (&[0, 45, 90], -1.0),
            (&[0, 45, 180], -3.0),
            (&[90, 0, 270], -1.2),
            (&[0, 180, 90], -1.2),
            (&[0, 90, 270], -2.0),
            (&[45, 0, 180], -2.5),
        ],
        4 => &[
            (&[0, 90, 180, 270], 0.0),
            (&[0, 45, 90, 180], -0.3),
            (&[0, 90, 270, 180], -1.2),
            (&[0, 180, 90, 270], -1.2),
            (&[0, 45, 90, 135], -2.0),
            (&[0, 45, 180, 225], -3.0),
            (&[45, 0, 90, 180], -2.5),
        ],
        5 => &[
            (&[0, 45, 90, 135, 180], 0.0),
            (&[0, 45, 90, 180, 270], -1.0),
            (&[0, 45, 90, 180, 225], -1.5),
            (&[90, 45, 0, 315, 270], -1.5),
        ],
        6 => &[
            (&[0, 45, 90, 135, 180, 270], -0.2),
            (&[0, 45, 90, 135, 180, 225], -0.4),
            (&[0, 45, 90, 180, 270, 315], -0.6),
        ],
        7 => &[(&[0, 45, 90, 135, 180, 225, 270], 0.0), (&[0, 30, 60, 90, 120, 150, 180], -0.7)],
        _ => &[],
    }
}

/// Orders to be tried for `count` views on a page.
pub(crate) fn on_page(count: usize) -> Vec<Layout> {
    let mut layouts = Vec::new();
    let mut even = if count > 3 { turns(count) } else { Vec::new() };
    if ![4, 8].contains(&count) {
        even.iter_mut().for_each(|layout| layout.prior += ODD_STEP);
    }
    let named = usual(count).iter().map(|(azimuths, prior)| {
        (azimuths.iter().map(|degrees| f64::from(*degrees)).collect::<Vec<f64>>(), *prior)
    });
    for (azimuths, prior) in named {
        for (mirrored, m) in [(false, 0.0), (true, OTHER_WAY)] {
            for (reversed, r) in [(false, 0.0), (true, REVERSED)] {
                let turned = |a: &f64| if mirrored { (360.0 - a) % 360.0 } else { *a };
                let mut azimuths: Vec<f64> = azimuths.iter().map(turned).collect();
                if reversed {
                    azimuths.reverse();
                }
                layouts.push(Layout { azimuths, prior: prior + m + r });
            }
        }
    }
    layouts.extend(even);
    let mut seen: Vec<Layout> = Vec::new();
    for layout in layouts {
        match seen.iter_mut().find(|other| other.azimuths == layout.azimuths) {
            Some(other) => other.prior = other.prior.max(layout.prior),
            None => seen.push(layout),
        }
    }
    seen
}

/// Full turns of even steps, from any start and either way.
pub(crate) fn turns(count: usize) -> Vec<Layout> {
    let step = 360.0 / count.max(1) as f64;
    let mut layouts = Vec::new();
    for (sign, prior) in [(1.0, 0.0), (-1.0, OTHER_WAY)] {
        for start in 0..count {
            let azimuth = |k: usize| {
                let steps = (sign * k as f64 + start as f64).rem_euclid(count as f64);
                steps * step % 360.0
            };
            let azimuths = (0..count).map(azimuth).collect();
            let later = if start == 0 { 0.0 } else { LATER_START };
            layouts.push(Layout { azimuths, prior: prior + later });
        }
    }
    layouts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_order_has_its_views_once_each() {
        for count in 1..=12 {
            let layouts = on_page(count);
            assert!(!layouts.is_empty());
            for layout in layouts {
                assert_eq!(layout.azimuths.len(), count);
                let mut sorted = layout.azimuths.clone();
                sorted.sort_by(f64::total_cmp);
                assert!(sorted.windows(2).all(|pair| pair[1] - pair[0] > 1.0), "{sorted:?}");
                assert!(sorted.iter().all(|a| (0.0..360.0).contains(a)));
            }
        }
    }
}
