use std::fmt;
use std::str::FromStr;

use thiserror::Error;

/// A family of wires and rigs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Family {
    /// The simulator of the ACCURATE paper: 50 to 120 units long, 512 x 2048 px.
    SimPaper,
    /// Spline through a random walk of 5 control points, 512 x 512 px.
    Easy,
    /// Spline through a random walk of 5 to 8 control points, 512 x 512 px.
    Medium,
    /// Spline through a random walk of 9 to 12 control points, 512 x 512 px.
    Hard,
    /// Helices of radius 15 to 40 units, 512 x 512 px.
    Helix,
    /// Curves that follow the epipolar direction for at least three stretches, 512 x 512 px.
    Tangency,
    /// Guidewires on vessel-like paths under a C-arm, millimetres, 500 x 500 px.
    Carm,
}

impl Family {
    /// All families, in the order of their help texts.
    pub const ALL: [Self; 7] = [
        Self::SimPaper,
        Self::Easy,
        Self::Medium,
        Self::Hard,
        Self::Helix,
        Self::Tangency,
        Self::Carm,
    ];

    /// The name as typed: `sim-paper`, `easy`, `medium`, `hard`, `helix`, `tangency` or `carm`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::SimPaper => "sim-paper",
            Self::Easy => "easy",
            Self::Medium => "medium",
            Self::Hard => "hard",
            Self::Helix => "helix",
            Self::Tangency => "tangency",
            Self::Carm => "carm",
        }
    }

    /// One line for a help text.
    pub const fn describe(self) -> &'static str {
        match self {
            Self::SimPaper => {
                "the paper's simulator: J-tipped wires of 50-120 units, views 30-50 deg apart, 512x2048"
            }
            Self::Easy => "spline through 5 random control points, views 60-100 deg apart, 512x512",
            Self::Medium => "as easy, 5-8 control points: a few self-crossings",
            Self::Hard => "as easy, 9-12 control points: many self-crossings and overlaps",
            Self::Helix => "helices of radius 15-40 units in any direction, 512x512",
            Self::Tangency => {
                "curves that run along the epipolar direction for three or more stretches, 512x512"
            }
            Self::Carm => {
                "C-arm (SID 1195, SOD 720 mm), 0.035\" and 0.014\" wires with J tips and loops, 500x500"
            }
        }
    }
}

impl fmt::Display for Family {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// The text names no family.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("unknown family `{0}`: expected sim-paper, easy, medium, hard, helix, tangency or carm")]
pub struct UnknownFamily(pub String);

impl FromStr for Family {
    type Err = UnknownFamily;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        Self::ALL
            .into_iter()
            .find(|family| family.name() == text)
            .ok_or_else(|| UnknownFamily(text.to_owned()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_reads_back_as_its_family() {
        for family in Family::ALL {
            assert_eq!(family.to_string().parse::<Family>().unwrap(), family);
            assert!(!family.describe().contains('\n'));
        }
        assert_eq!("loops".parse::<Family>(), Err(UnknownFamily("loops".into())));
    }
}
