//! The transfer function of sRGB (IEC 61966-2-1).

use std::sync::LazyLock;

/// Linear light of a level in [0, 1] as displays are sent it.
pub fn linear_from_srgb(level: f32) -> f32 {
    if level <= 0.04045 { level / 12.92 } else { libm::powf((level + 0.055) / 1.055, 2.4) }
}

/// [`linear_from_srgb`] of a byte.
pub fn linear_from_srgb_byte(level: u8) -> f32 {
    static LEVELS: LazyLock<[f32; 256]> =
        LazyLock::new(|| std::array::from_fn(|level| linear_from_srgb(level as f32 / 255.0)));
    LEVELS[usize::from(level)]
}

/// The nearest byte for linear light; what is outside of [0, 1] is clipped.
pub fn srgb_byte_from_linear(light: f32) -> u8 {
    let light = light.clamp(0.0, 1.0);
    let level = if light <= 0.003_130_8 {
        light * 12.92
    } else {
        1.055 * libm::powf(light, 1.0 / 2.4) - 0.055
    };
    (level * 255.0).round() as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_survive_the_way_there_and_back() {
        for level in 0..=255 {
            assert_eq!(srgb_byte_from_linear(linear_from_srgb_byte(level)), level);
        }
        // The standard's middle grey: 18 % of the light is level 118.
        assert_eq!(srgb_byte_from_linear(0.18), 118);
    }
}
