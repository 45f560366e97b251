use std::fmt;
use std::str::FromStr;

use accurate_baselines::{Baert, BaertTable, Baur, Hoffmann, HoffmannTable};
use accurate_match::{CurveMatcher, Ecdp, EcdpParams};

/// How a pair is reconstructed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Method {
    /// Our own method, the default.
    #[default]
    Accurate,
    /// The paper's protocol: GCTT, ECDP without the operator R (as the published table was made).
    Paper,
    /// The paper's protocol with the operator R.
    PaperRefined,
    /// Baert et al. 2003, a fair reading.
    Baert,
    /// Baert et al. as the paper's table ran it.
    BaertTable,
    /// Hoffmann et al. 2012, a fair reading.
    Hoffmann,
    /// Hoffmann et al. as the paper's table ran it.
    HoffmannTable,
    /// Baur et al. 2016, in its style.
    Baur,
}

impl Method {
    /// Every method, in the order of the tables.
    pub const ALL: [Self; 8] = [
        Self::Accurate,
        Self::Paper,
        Self::PaperRefined,
        Self::Baert,
        Self::BaertTable,
        Self::Hoffmann,
        Self::HoffmannTable,
        Self::Baur,
    ];

    /// The name on the command line.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Accurate => "accurate",
            Self::Paper => "paper",
            Self::PaperRefined => "paper-refined",
            Self::Baert => "baert",
            Self::BaertTable => "baert-table",
            Self::Hoffmann => "hoffmann",
            Self::HoffmannTable => "hoffmann-table",
            Self::Baur => "baur",
        }
    }

    /// The parameters of [`matcher`](Self::matcher), as text.
    pub(crate) fn matching_described(self) -> String {
        match self {
            Self::Accurate | Self::Paper => format!("{:?}", EcdpParams::PAPER),
            Self::PaperRefined => format!("{:?}", EcdpParams::PAPER_REFINED),
            Self::Baert => format!("{:?}", Baert::default()),
            Self::BaertTable => format!("{:?}", BaertTable::default()),
            Self::Hoffmann => format!("{:?}", Hoffmann::default()),
            Self::HoffmannTable => format!("{:?}", HoffmannTable::default()),
            Self::Baur => format!("{:?}", Baur::default()),
        }
    }

    /// The matcher of ordered curves behind the method.
    pub(crate) fn matcher(self) -> Box<dyn CurveMatcher> {
        match self {
            Self::Accurate | Self::Paper => Box::new(Ecdp { params: EcdpParams::PAPER }),
            Self::PaperRefined => Box::new(Ecdp { params: EcdpParams::PAPER_REFINED }),
            Self::Baert => Box::new(Baert::default()),
            Self::BaertTable => Box::new(BaertTable::default()),
            Self::Hoffmann => Box::new(Hoffmann::default()),
            Self::HoffmannTable => Box::new(HoffmannTable::default()),
            Self::Baur => Box::new(Baur::default()),
        }
    }
}

/// What of a pair is reconstructed from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum InputKind {
    /// Ordered centreline points of both views.
    Points,
    /// Binary masks of both views.
    Mask,
    /// Grey images of both views.
    Image,
}

impl InputKind {
    /// The name on the command line.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Points => "points",
            Self::Mask => "mask",
            Self::Image => "image",
        }
    }
}

/// A name that stands for nothing.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("unknown {what} `{name}`: {}expected one of {expected}", suggestion(name, expected))]
pub struct UnknownName {
    /// What was named.
    pub what: &'static str,
    /// The name given.
    pub name: String,
    /// The names there are.
    pub expected: String,
}

/// `did you mean ...?`, if one of the expected names is close.
fn suggestion(name: &str, expected: &str) -> String {
    /// Jaro-Winkler likeness from which a name counts as a typing error of another.
    const CLOSE: f64 = 0.8;
    let near = expected
        .split(", ")
        .map(|candidate| (strsim::jaro_winkler(candidate, name), candidate))
        .filter(|(likeness, _)| *likeness >= CLOSE)
        .max_by(|a, b| a.0.total_cmp(&b.0));
    near.map(|(_, candidate)| format!("did you mean `{candidate}`? ")).unwrap_or_default()
}

impl FromStr for Method {
    type Err = UnknownName;

    fn from_str(name: &str) -> Result<Self, Self::Err> {
        Self::ALL.into_iter().find(|m| m.name() == name).ok_or_else(|| UnknownName {
            what: "method",
            name: name.to_owned(),
            expected: Self::ALL.map(Self::name).join(", "),
        })
    }
}

impl FromStr for InputKind {
    type Err = UnknownName;

    fn from_str(name: &str) -> Result<Self, Self::Err> {
        let all = [Self::Points, Self::Mask, Self::Image];
        all.into_iter().find(|i| i.name() == name).ok_or_else(|| UnknownName {
            what: "input",
            name: name.to_owned(),
            expected: all.map(Self::name).join(", "),
        })
    }
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl fmt::Display for InputKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_typing_error_is_told_the_name_that_was_meant() {
        let error = "hofmann".parse::<Method>().unwrap_err().to_string();
        assert!(error.contains("did you mean `hoffmann`?"), "{error}");
        let error = "xyz".parse::<Method>().unwrap_err().to_string();
        assert!(!error.contains("did you mean"), "{error}");
    }
}
