use accurate3d::seg::Polarity;
use clap::{Args, ValueEnum};

/// What the grey values of images mean.
#[derive(Debug, Args)]
pub struct GreyArgs {
    /// Whether the body is dark or bright in the images (of DICOM files, as they are shown: those that
    /// say that they are inverted are turned round on reading).
    #[arg(long, value_enum, default_value_t = Photometric::Monochrome2)]
    pub photometric: Photometric,
}

impl GreyArgs {
    pub const fn polarity(&self) -> Polarity {
        match self.photometric {
            Photometric::Monochrome2 => Polarity::BodyDark,
            Photometric::Monochrome1 => Polarity::BodyBright,
        }
    }
}

/// Meaning of an image's values.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Photometric {
    /// The body is darker than its surroundings.
    Monochrome2,
    /// The stored values are inverted: the body is brighter.
    Monochrome1,
}

impl Photometric {
    /// As the option names it.
    pub fn name(self) -> String {
        self.to_possible_value().map_or_else(String::new, |value| value.get_name().to_owned())
    }
}
