use std::fmt;
use std::str::FromStr;

/// The unit of world lengths: a label that travels with the numbers, never a conversion.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum LengthUnit {
    /// Millimetres.
    Millimetre,
    /// Centimetres.
    Centimetre,
    /// Metres.
    Metre,
    /// A simulator's unit without physical size. The paper heads its simulation columns "pixel";
    /// they are in this unit, about 10 image pixels.
    #[default]
    Unit,
}

impl LengthUnit {
    /// The label as written to files: `mm`, `cm`, `m` or `unit`.
    pub const fn label(self) -> &'static str {
        match self {
            Self::Millimetre => "mm",
            Self::Centimetre => "cm",
            Self::Metre => "m",
            Self::Unit => "unit",
        }
    }
}

impl fmt::Display for LengthUnit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.label())
    }
}

/// The text names no known unit.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("unknown unit `{0}`: expected mm, cm, m or unit")]
pub struct UnknownUnit(pub String);

impl FromStr for LengthUnit {
    type Err = UnknownUnit;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        match text {
            "mm" => Ok(Self::Millimetre),
            "cm" => Ok(Self::Centimetre),
            "m" => Ok(Self::Metre),
            "unit" => Ok(Self::Unit),
            _ => Err(UnknownUnit(text.to_owned())),
        }
    }
}
