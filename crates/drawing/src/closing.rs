//! Outlines that close: the boundary of the drawn mask is inked where strokes
//! leave a way in.

use image::GrayImage;
use picture::{border, flooded};

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
    let paper = ink.as_raw().iter().map(|&level| level <= INK).collect();
    // Where the model reaches the border, it is cut off, not open.
    let mut seeds = border(width, height);
    seeds.retain(|&at| mask.as_raw()[at] == 0);
    let reached = flooded(width, paper, seeds);
    reached.iter().zip(mask.as_raw()).any(|(reached, mask)| *reached && *mask != 0)
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
