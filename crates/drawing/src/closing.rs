//! Outlines that close: the boundary of the drawn mask is inked where strokes
//! leave a way in.

use image::GrayImage;

/// A pixel with more ink holds a flood back; 255 is all covered.
const INK: u8 = 51;

/// Inks the mask's boundary where a flood from the picture's border would get
/// inside: strokes of edges seen exactly along themselves, of coarse meshes and
/// of open ones leave gaps. A drawing whose strokes close is left as it is.
///
/// * `ink`: how much of each pixel is covered.
/// * `mask`: where the model is, of the same size.
pub(super) fn close_outline(ink: &mut GrayImage, mask: &GrayImage) {
    let (width, height) = (ink.width() as usize, ink.height() as usize);
    if !leaks(ink, mask) {
        return;
    }
    let inside = |x: usize, y: usize| mask.as_raw()[y * width + x] != 0;
    let at_paper = |x: usize, y: usize| {
        (x > 0 && !inside(x - 1, y))
            || (x + 1 < width && !inside(x + 1, y))
            || (y > 0 && !inside(x, y - 1))
            || (y + 1 < height && !inside(x, y + 1))
    };
    for y in 0..height {
        for x in 0..width {
            if inside(x, y) && at_paper(x, y) {
                ink.as_mut()[y * width + x] = 255;
            }
        }
    }
}

/// Whether paper that is connected to the picture's border lies in the mask.
fn leaks(ink: &GrayImage, mask: &GrayImage) -> bool {
    let (width, height) = (ink.width() as usize, ink.height() as usize);
    let (ink, mask) = (ink.as_raw(), mask.as_raw());
    let mut reached = vec![false; width * height];
    let border = (0..width).flat_map(|x| [x, (height - 1) * width + x]);
    let sides = (0..height).flat_map(|y| [y * width, y * width + width - 1]);
    // Where the model reaches the border, it is cut off, not open.
    let mut pending: Vec<usize> = border.chain(sides).filter(|&at| mask[at] == 0).collect();
    while let Some(at) = pending.pop() {
        if reached[at] || ink[at] > INK {
            continue;
        }
        if mask[at] != 0 {
            return true;
        }
        reached[at] = true;
        let (x, y) = (at % width, at / width);
        let left = (x > 0).then(|| at - 1);
        let right = (x + 1 < width).then_some(at + 1);
        let above = (y > 0).then(|| at - width);
        let below = (y + 1 < height).then_some(at + width);
        pending.extend([left, right, above, below].into_iter().flatten());
    }
    false
}

#[cfg(test)]
mod tests {
    use image::Luma;

    use super::*;

    #[test]
    fn only_an_open_outline_is_inked() {
        let mask = GrayImage::from_fn(20, 20, |x, y| {
            Luma([if (5..15).contains(&x) && (5..15).contains(&y) { 255 } else { 0 }])
        });
        let outline = GrayImage::from_fn(20, 20, |x, y| {
            let inside = (5..15).contains(&x) && (5..15).contains(&y);
            let edge = [5, 14].contains(&x) || [5, 14].contains(&y);
            Luma([if inside && edge { 255 } else { 0 }])
        });
        let mut closed = outline.clone();
        close_outline(&mut closed, &mask);
        assert_eq!(closed, outline);
        let mut open = outline.clone();
        (7..12).for_each(|x| open.put_pixel(x, 14, Luma([0])));
        assert!(leaks(&open, &mask));
        close_outline(&mut open, &mask);
        assert_eq!(open, outline);
    }
}
