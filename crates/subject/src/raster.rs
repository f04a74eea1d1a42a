//! Binary and scalar rasters and the image operations that every stage needs:
//! flooding, distance maps, connected components and polygons.

use crate::report::{Box2, Point};
use picture::{border, flooded};

/// A rectangle of values, row by row.
#[derive(Clone, Debug)]
pub struct Raster<T> {
    /// Values a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Row by row.
    pub data: Vec<T>,
}

/// Which pixels belong to something.
pub type Bits = Raster<bool>;

impl<T: Clone> Raster<T> {
    /// The same value everywhere.
    pub fn filled(width: usize, height: usize, value: T) -> Self {
        Self { width, height, data: vec![value; width * height] }
    }

    /// The values of the row `y`.
    pub fn row(&self, y: usize) -> &[T] {
        &self.data[y * self.width..(y + 1) * self.width]
    }
}

impl<T: Copy> Raster<T> {
    /// Columns as rows.
    #[must_use]
    pub fn transposed(&self) -> Self {
        let column = |x: usize| (0..self.height).map(move |y| y * self.width + x);
        let data = (0..self.width).flat_map(column).map(|index| self.data[index]).collect();
        Self { width: self.height, height: self.width, data }
    }
}

impl<T: Copy + Default> Raster<T> {
    /// The value at `(x, y)`; the type's default outside.
    pub fn at(&self, x: i64, y: i64) -> T {
        let inside = x >= 0 && y >= 0 && (x as usize) < self.width && (y as usize) < self.height;
        if inside { self.data[y as usize * self.width + x as usize] } else { T::default() }
    }
}

impl Bits {
    /// How many pixels are set.
    pub fn count(&self) -> usize {
        self.data.iter().filter(|is| **is).count()
    }

    /// Sets or clears a pixel; nothing happens outside.
    pub fn set(&mut self, x: i64, y: i64, value: bool) {
        if x >= 0 && y >= 0 && (x as usize) < self.width && (y as usize) < self.height {
            self.data[y as usize * self.width + x as usize] = value;
        }
    }

    /// What is not set.
    #[must_use]
    pub fn not(&self) -> Self {
        Self {
            width: self.width,
            height: self.height,
            data: self.data.iter().map(|is| !is).collect(),
        }
    }

    /// What is set in either; both have the same size.
    #[must_use]
    pub fn or(mut self, other: &Self) -> Self {
        self.data.iter_mut().zip(&other.data).for_each(|(own, other)| *own |= other);
        self
    }

    /// What is set here and not in `other`, which has the same size.
    #[must_use]
    pub fn and_not(mut self, other: &Self) -> Self {
        self.data.iter_mut().zip(&other.data).for_each(|(own, other)| *own &= !other);
        self
    }

    /// The bounds of what is set.
    pub fn bounds(&self) -> Option<Box2> {
        let mut found: Option<Box2> = None;
        for y in 0..self.height {
            let row = self.row(y);
            let Some(first) = row.iter().position(|is| *is) else { continue };
            let last = row.iter().rposition(|is| *is).unwrap_or(first);
            let (x0, x1, y) = (first as u32, last as u32 + 1, y as u32);
            found = Some(match found {
                None => Box2 { left: x0, top: y, right: x1, bottom: y + 1 },
                Some(b) => {
                    Box2 { left: b.left.min(x0), top: b.top, right: b.right.max(x1), bottom: y + 1 }
                }
            });
        }
        found
    }

    /// Euclidean distance from each pixel to the nearest set one, px; pixels
    /// that are set have 0. Without any set pixel all are far (1e6).
    ///
    /// # Source
    /// Felzenszwalb & Huttenlocher 2012, Distance transforms of sampled functions.
    pub fn distance(&self) -> Raster<f32> {
        let (w, h) = (self.width, self.height);
        // Down the columns a simple two-way scan of linear distance is exact.
        let mut squared: Vec<f32> = self
            .along_columns()
            .iter()
            .map(|&near| if near == NONE { FAR } else { near as f32 })
            .collect();
        let mut lower = Lower::with_capacity(w.max(h));
        for row in squared.chunks_exact_mut(w.max(1)) {
            row.iter_mut().for_each(|value| *value *= *value);
            lower.transform(row);
            row.iter_mut().for_each(|value| *value = value.sqrt().min(FAR));
        }
        Raster { width: w, height: h, data: squared }
    }

    /// How far each pixel is from the nearest set one of its column, px; [`NONE`] without any.
    fn along_columns(&self) -> Vec<u32> {
        let width = self.width.max(1);
        let mut along = vec![NONE; self.data.len()];
        let mut near = vec![NONE; self.width];
        let step = |near: &mut [u32], set: &[bool]| {
            for (near, set) in near.iter_mut().zip(set) {
                *near = if *set { 0 } else { near.saturating_add(1).min(NONE) };
            }
        };
        for (along, set) in along.chunks_exact_mut(width).zip(self.data.chunks_exact(width)) {
            step(&mut near, set);
            along.copy_from_slice(&near);
        }
        near.fill(NONE);
        for (along, set) in along.chunks_exact_mut(width).zip(self.data.chunks_exact(width)).rev() {
            step(&mut near, set);
            along.iter_mut().zip(&near).for_each(|(along, near)| *along = (*along).min(*near));
        }
        along
    }

    /// What is within `radius` pixels of something set.
    #[must_use]
    pub fn dilated(&self, radius: f32) -> Self {
        // The half width of the disc by distance from its middle row.
        let is_near = |dx: usize, dy: usize| ((dx * dx + dy * dy) as f32).sqrt() <= radius;
        let mut halves = Vec::new();
        let mut half = (radius.max(0.0) as usize).saturating_add(1).min(self.width);
        while is_near(0, halves.len()) && halves.len() <= self.height {
            while !is_near(half, halves.len()) {
                half -= 1;
            }
            halves.push(half);
        }
        let width = self.width.max(1);
        let along = self.along_columns();
        let mut data = Vec::with_capacity(self.data.len());
        // By column how many more discs begin there than ended before it.
        let mut steps = vec![0_i32; width + 1];
        for along in along.chunks_exact(width) {
            steps.fill(0);
            for (x, &dy) in along.iter().enumerate() {
                if let Some(&half) = halves.get(dy as usize) {
                    steps[x.saturating_sub(half)] += 1;
                    steps[(x + half + 1).min(width)] -= 1;
                }
            }
            data.extend(steps[..width].iter().scan(0, |open, step| {
                *open += step;
                Some(*open > 0)
            }));
        }
        Self { width: self.width, height: self.height, data }
    }

    /// What is farther than `radius` pixels from everything that is not set.
    #[must_use]
    pub fn eroded(&self, radius: f32) -> Self {
        self.not().dilated(radius).not()
    }

    /// What a disc of this radius covers that stays within.
    #[must_use]
    pub fn opened(&self, radius: f32) -> Self {
        self.eroded(radius).dilated(radius)
    }

    /// What no disc of this radius covers that stays off the set pixels; beyond the image it may lie.
    #[must_use]
    pub fn closed(&self, radius: f32) -> Self {
        let margin = radius.max(0.0).ceil() as usize + 1;
        let wide = self.moved([margin; 2], [self.width + 2 * margin, self.height + 2 * margin]);
        let own = wide.dilated(radius).eroded(radius);
        let rows = own.data.chunks_exact(own.width).skip(margin).take(self.height);
        let data = rows.flat_map(|row| &row[margin..margin + self.width]).copied().collect();
        Self { width: self.width, height: self.height, data }
    }

    /// With its first pixel at `to` of a larger raster of `size`.
    fn moved(&self, to: [usize; 2], size: [usize; 2]) -> Self {
        let mut all = Self::filled(size[0], size[1], false);
        let rows = all.data.chunks_exact_mut(size[0]).skip(to[1]);
        for (row, own) in rows.zip(self.data.chunks_exact(self.width.max(1))) {
            row[to[0]..to[0] + self.width].copy_from_slice(own);
        }
        all
    }

    /// The set pixels connected (by sides) to the image's border.
    #[must_use]
    pub fn reached_from_border(&self) -> Self {
        self.flooded(border(self.width, self.height))
    }

    /// The set pixels connected (by sides) to `seeds`, which are indices.
    #[must_use]
    pub fn flooded(&self, seeds: Vec<usize>) -> Self {
        let data = flooded(self.width, self.data.clone(), seeds);
        Self { width: self.width, height: self.height, data }
    }

    /// Parts connected by sides and corners, in the order of their first pixel.
    pub fn components(&self, corners: bool) -> Components {
        Components::of(self, corners)
    }

    /// Sets the pixels whose centre is inside `polygon`.
    pub fn fill_polygon(&mut self, polygon: &[Point], value: bool) {
        for y in 0..self.height {
            let mid = y as f64 + 0.5;
            let mut crossings: Vec<f64> = Vec::new();
            for (index, a) in polygon.iter().enumerate() {
                let b = &polygon[(index + 1) % polygon.len()];
                if (a.y <= mid) != (b.y <= mid) {
                    crossings.push(a.x + (mid - a.y) / (b.y - a.y) * (b.x - a.x));
                }
            }
            crossings.retain(|x| x.is_finite());
            crossings.sort_by(f64::total_cmp);
            for pair in crossings.chunks_exact(2) {
                let from = (pair[0] - 0.5).ceil().clamp(0.0, self.width as f64) as usize;
                let to = (pair[1] - 0.5).ceil().clamp(0.0, self.width as f64) as usize;
                if from < to {
                    self.data[y * self.width + from..y * self.width + to].fill(value);
                }
            }
        }
    }
}

/// What is farther than all pictures are wide, px.
const FAR: f32 = 1e6;
const NONE: u32 = 1_000_000;

/// The lower envelope of parabolas, with its buffers.
struct Lower {
    source: Vec<f32>,
    place: Vec<usize>,
    from: Vec<f32>,
}

impl Lower {
    fn with_capacity(count: usize) -> Self {
        Self {
            source: Vec::with_capacity(count),
            place: Vec::with_capacity(count),
            from: Vec::with_capacity(count + 1),
        }
    }

    /// From 0 to 0 nothing beyond matters, and 0 stays.
    fn transform(&mut self, row: &mut [f32]) {
        let mut rest = row;
        loop {
            let zeros = rest.iter().take_while(|value| **value == 0.0).count();
            rest = &mut rest[zeros.saturating_sub(1)..];
            let skip = usize::from(zeros > 0);
            let next = rest.iter().skip(skip).position(|value| *value == 0.0);
            let end = next.map_or(rest.len(), |next| skip + next + 1);
            if end > skip {
                self.transform_run(&mut rest[..end]);
            }
            let Some(next) = next else { return };
            rest = &mut rest[skip + next..];
        }
    }

    fn transform_run(&mut self, row: &mut [f32]) {
        self.source.clear();
        self.source.extend_from_slice(row);
        self.place.clear();
        self.from.clear();
        let f = &self.source;
        for q in (0..f.len()).filter(|&q| f[q] < FAR * FAR) {
            let crossing = |p: usize| {
                let (fq, fp) = (f64::from(f[q]), f64::from(f[p]));
                let (q, p) = (q as f64, p as f64);
                (((fq + q * q) - (fp + p * p)) / (2.0 * (q - p))) as f32
            };
            let mut from = f32::NEG_INFINITY;
            while let (Some(&p), Some(&first)) = (self.place.last(), self.from.last()) {
                let own = crossing(p);
                if own > first {
                    from = own;
                    break;
                }
                self.place.pop();
                self.from.pop();
            }
            self.place.push(q);
            self.from.push(from);
        }
        if self.place.is_empty() {
            return;
        }
        let mut k = 0;
        for (x, value) in row.iter_mut().enumerate() {
            while k + 1 < self.place.len() && self.from[k + 1] < x as f32 {
                k += 1;
            }
            let p = self.place[k];
            let away = x as f32 - p as f32;
            *value = f[p] + away * away;
        }
    }
}

/// One connected part.
#[derive(Clone, Copy, Debug)]
pub struct Component {
    /// Its pixels.
    pub area: usize,
    /// The smallest rectangle around it.
    pub bounds: Box2,
}

/// The connected parts of a [`Bits`].
pub struct Components {
    /// Per pixel 0, or one more than the part's index.
    pub labels: Vec<u32>,
    /// In the order of their first pixel.
    pub parts: Vec<Component>,
}

impl Components {
    fn of(bits: &Bits, corners: bool) -> Self {
        let (w, h) = (bits.width, bits.height);
        let mut labels = vec![0_u32; w * h];
        let mut parent: Vec<u32> = vec![0];
        fn root(parent: &mut [u32], mut label: u32) -> u32 {
            while parent[label as usize] != label {
                let up = parent[parent[label as usize] as usize];
                parent[label as usize] = up;
                label = up;
            }
            label
        }
        let reach = usize::from(corners);
        for y in 0..h {
            let mut x = 0;
            while x < w {
                if !bits.data[y * w + x] {
                    x += 1;
                    continue;
                }
                let from = x;
                while x < w && bits.data[y * w + x] {
                    x += 1;
                }
                let mut own = 0;
                if y > 0 {
                    let mut last = 0;
                    for above in from.saturating_sub(reach)..(x + reach).min(w) {
                        let label = labels[(y - 1) * w + above];
                        if label == 0 || label == last {
                            continue;
                        }
                        last = label;
                        let other = root(&mut parent, label);
                        if own == 0 {
                            own = other;
                        } else if own != other {
                            let (low, high) = (own.min(other), own.max(other));
                            parent[high as usize] = low;
                            own = low;
                        }
                    }
                }
                if own == 0 {
                    own = parent.len() as u32;
                    parent.push(own);
                }
                labels[y * w + from..y * w + x].fill(own);
            }
        }
        let mut compact = vec![0_u32; parent.len()];
        let mut parts: Vec<Component> = Vec::new();
        for (index, label) in labels.iter_mut().enumerate().filter(|(_, label)| **label != 0) {
            let found = root(&mut parent, *label) as usize;
            let (x, y) = ((index % w) as u32, (index / w) as u32);
            if compact[found] == 0 {
                let bounds = Box2 { left: x, top: y, right: x + 1, bottom: y + 1 };
                parts.push(Component { area: 0, bounds });
                compact[found] = parts.len() as u32;
            }
            *label = compact[found];
            let part = &mut parts[compact[found] as usize - 1];
            part.area += 1;
            part.bounds.left = part.bounds.left.min(x);
            part.bounds.right = part.bounds.right.max(x + 1);
            part.bounds.bottom = y + 1;
        }
        Self { labels, parts }
    }

    /// The pixels of the parts that `keep` names, by index.
    pub fn select(&self, width: usize, keep: impl Fn(usize) -> bool) -> Bits {
        let kept: Vec<bool> = (0..self.parts.len()).map(keep).collect();
        let data: Vec<bool> =
            self.labels.iter().map(|&label| label != 0 && kept[label as usize - 1]).collect();
        Bits { width, height: data.len() / width.max(1), data }
    }
}

/// What paper connected to the border does not reach, where `barrier` holds it
/// off; openings of up to two pixels hold it off too.
pub fn filled(barrier: &Bits) -> Bits {
    let near = grown(barrier);
    let mut outside = near.not().reached_from_border();
    // Paper creeps back to the lines that it was held off from.
    let (w, h) = (barrier.width, barrier.height);
    let reached = grown(&outside);
    for y in 0..h {
        for x in 0..w {
            let index = y * w + x;
            if reached.data[index] && near.data[index] && !barrier.data[index] {
                outside.data[index] = true;
            }
        }
    }
    outside.not()
}

/// Dilated by one pixel in all eight directions.
pub fn grown(bits: &Bits) -> Bits {
    let (w, h) = (bits.width, bits.height);
    let mut wide = bits.clone();
    for (row, from) in wide.data.chunks_exact_mut(w.max(1)).zip(bits.data.chunks_exact(w.max(1))) {
        row.iter_mut().skip(1).zip(from).for_each(|(own, before)| *own |= before);
        row.iter_mut().zip(from.iter().skip(1)).for_each(|(own, after)| *own |= after);
    }
    let mut grown = wide.clone();
    for y in 0..h {
        for other in [y.checked_sub(1), (y + 1 < h).then_some(y + 1)].into_iter().flatten() {
            let from = &wide.data[other * w..(other + 1) * w];
            let row = &mut grown.data[y * w..(y + 1) * w];
            row.iter_mut().zip(from).for_each(|(own, other)| *own |= other);
        }
    }
    grown
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ring(side: usize, gap: usize) -> Bits {
        let mut bits = Bits::filled(side, side, false);
        for k in 4..side - 4 {
            for (x, y) in [(k, 4), (k, side - 5), (4, k), (side - 5, k)] {
                bits.data[y * side + x] = true;
            }
        }
        bits.data[4 * side + 8..4 * side + 8 + gap].fill(false);
        bits
    }

    #[test]
    fn a_ring_is_filled_and_a_wide_opening_lets_paper_in() {
        assert_eq!(filled(&ring(24, 0)).count(), 16 * 16);
        assert!(filled(&ring(24, 2)).count() >= 16 * 16 - 2);
        assert!(filled(&ring(24, 6)).count() < 100);
    }

    #[test]
    fn distances_are_euclidean() {
        let mut bits = Bits::filled(9, 9, false);
        bits.data[4 * 9 + 4] = true;
        let distance = bits.distance();
        assert!((distance.at(7, 8) - 5.0).abs() < 1e-5);
        assert_eq!(distance.at(4, 4), 0.0);
        assert_eq!(Bits::filled(3, 2, false).distance().data[0], 1e6);
        assert!(Bits::filled(0, 0, false).distance().data.is_empty());
    }

    #[test]
    fn dilation_is_a_limit_of_distance() {
        let mut seed = 1_u32;
        for (width, height) in [(17, 11), (1, 9), (9, 1), (30, 30)] {
            let mut bits = Bits::filled(width, height, false);
            for pixel in &mut bits.data {
                seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                *pixel = seed >> 24 < 12;
            }
            let (distance, depth) = (bits.distance(), bits.not().distance());
            let nearest = |x: usize, y: usize, of: &Bits| {
                let set = (0..width * height).filter(|&i| of.data[i]);
                let squares =
                    set.map(|i| (i % width).abs_diff(x).pow(2) + (i / width).abs_diff(y).pow(2));
                squares.min().map_or(1e6, |square| (square as f32).sqrt())
            };
            for i in 0..width * height {
                assert_eq!(distance.data[i], nearest(i % width, i / width, &bits));
                assert_eq!(depth.data[i], nearest(i % width, i / width, &bits.not()));
            }
            for radius in [-1.0, 0.0, 0.7, 1.0, 2.0_f32.sqrt(), 2.3, 5.0, 40.0] {
                let within: Vec<bool> = distance.data.iter().map(|d| *d <= radius).collect();
                assert_eq!(bits.dilated(radius).data, within, "{radius}");
                let beyond: Vec<bool> = depth.data.iter().map(|d| *d > radius).collect();
                assert_eq!(bits.eroded(radius).data, beyond, "{radius}");
            }
        }
    }

    #[test]
    fn parts_are_counted_once() {
        let mut bits = Bits::filled(6, 4, false);
        for (x, y) in [(0, 0), (2, 0), (1, 1), (5, 3)] {
            bits.set(x, y, true);
        }
        assert_eq!(bits.components(true).parts.len(), 2);
        assert_eq!(bits.components(false).parts.len(), 4);
        assert_eq!(bits.components(true).parts[0].area, 3);
    }
}
