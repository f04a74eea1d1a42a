//! What is behind a drawing.

use std::borrow::Cow;
use std::fmt;
use std::str::FromStr;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Serialize};

/// What is behind a drawing; as text `white`, `grey`, `transparent` or `#rrggbb`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum Background {
    /// White paper.
    #[default]
    White,
    /// Grey paper, #808080.
    Grey,
    /// Nothing: the picture has an alpha channel.
    Transparent,
    /// Paper of any colour, sRGB.
    Colour([u8; 3]),
}

impl Background {
    /// The paper's colour, sRGB; `None` if there is none.
    pub fn paper(self) -> Option<[u8; 3]> {
        match self {
            Self::White => Some([255; 3]),
            Self::Grey => Some([128; 3]),
            Self::Colour(colour) => Some(colour),
            Self::Transparent => None,
        }
    }

    /// The level of lines that show on it: black, but white on what is dark.
    pub(super) fn contrasting(self) -> u8 {
        let [r, g, b] = self.paper().unwrap_or([255; 3]).map(u32::from);
        // Luma of Rec. 601.
        if 299 * r + 587 * g + 114 * b < 85_000 { 255 } else { 0 }
    }
}

impl FromStr for Background {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        match text {
            "white" => return Ok(Self::White),
            "grey" => return Ok(Self::Grey),
            "transparent" => return Ok(Self::Transparent),
            _ => {}
        }
        let digits = text.strip_prefix('#').filter(|digits| {
            digits.len() == 6 && digits.bytes().all(|digit| digit.is_ascii_hexdigit())
        });
        let colour = digits.and_then(|digits| u32::from_str_radix(digits, 16).ok());
        let [_, r, g, b] = colour
            .ok_or_else(|| format!("{text} is none of white, grey, transparent, #rrggbb"))?
            .to_be_bytes();
        Ok(Self::Colour([r, g, b]))
    }
}

impl fmt::Display for Background {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::White => f.write_str("white"),
            Self::Grey => f.write_str("grey"),
            Self::Transparent => f.write_str("transparent"),
            Self::Colour([r, g, b]) => write!(f, "#{r:02x}{g:02x}{b:02x}"),
        }
    }
}

impl TryFrom<String> for Background {
    type Error = String;

    fn try_from(text: String) -> Result<Self, Self::Error> {
        text.parse()
    }
}

impl From<Background> for String {
    fn from(background: Background) -> Self {
        background.to_string()
    }
}

impl JsonSchema for Background {
    fn schema_name() -> Cow<'static, str> {
        "Background".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "type": "string",
            "pattern": "^(white|grey|transparent|#[0-9a-fA-F]{6})$",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_are_read_and_written() {
        for text in ["white", "grey", "transparent", "#00ff7a"] {
            assert_eq!(text.parse::<Background>().unwrap().to_string(), text);
        }
        assert_eq!("#102030".parse(), Ok(Background::Colour([16, 32, 48])));
        for text in ["", "#12345", "#+12345", "#1234567", "White", "#gg0000", "#é0000"] {
            assert!(text.parse::<Background>().is_err(), "{text}");
        }
    }

    #[test]
    fn lines_are_white_on_what_is_dark() {
        assert_eq!(Background::Colour([20, 30, 90]).contrasting(), 255);
        assert_eq!(Background::Grey.contrasting(), 0);
        assert_eq!(Background::Transparent.contrasting(), 0);
    }
}
