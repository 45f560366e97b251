use std::fmt;
use std::str::FromStr;

use accurate3d::UnknownName;

/// A kind of failure: a name that stays the same from version to version, an exit code for scripts,
/// and a text for people (`accurate explain CODE`).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Code {
    Internal,
    Usage,
    NoReconstruction,
    Suspect,
    NoOrder,
    NoMatch,
    NoFit,
    BadInput,
    Calibration,
    SizeMismatch,
    TooLarge,
    Malformed,
    NotFinite,
    Unsupported,
    BadMask,
    CellsOutside,
    NotReproduced,
    NoInput,
    NoPair,
    Unavailable,
    Io,
}

impl Code {
    pub const ALL: [Self; 21] = [
        Self::Internal,
        Self::Usage,
        Self::NoReconstruction,
        Self::Suspect,
        Self::NoOrder,
        Self::NoMatch,
        Self::NoFit,
        Self::BadInput,
        Self::Calibration,
        Self::SizeMismatch,
        Self::TooLarge,
        Self::Malformed,
        Self::NotFinite,
        Self::Unsupported,
        Self::BadMask,
        Self::CellsOutside,
        Self::NotReproduced,
        Self::NoInput,
        Self::NoPair,
        Self::Unavailable,
        Self::Io,
    ];

    /// The stable name: `A` and three digits.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Internal => "A001",
            Self::Usage => "A002",
            Self::CellsOutside => "A003",
            Self::NotReproduced => "A004",
            Self::NoReconstruction => "A010",
            Self::Suspect => "A011",
            Self::NoOrder => "A012",
            Self::NoMatch => "A013",
            Self::NoFit => "A014",
            Self::BadInput => "A020",
            Self::Calibration => "A021",
            Self::SizeMismatch => "A022",
            Self::TooLarge => "A023",
            Self::Malformed => "A024",
            Self::NotFinite => "A025",
            Self::Unsupported => "A026",
            Self::BadMask => "A027",
            Self::NoInput => "A030",
            Self::NoPair => "A031",
            Self::Unavailable => "A040",
            Self::Io => "A050",
        }
    }

    /// What the process exits with.
    pub const fn exit(self) -> u8 {
        match self {
            Self::Internal | Self::CellsOutside | Self::NotReproduced => 1,
            Self::Usage => 2,
            Self::NoReconstruction | Self::NoOrder | Self::NoMatch | Self::NoFit => 3,
            Self::Suspect => 4,
            Self::BadInput
            | Self::Calibration
            | Self::SizeMismatch
            | Self::TooLarge
            | Self::Malformed
            | Self::NotFinite
            | Self::Unsupported
            | Self::BadMask => 65,
            Self::NoInput | Self::NoPair => 66,
            Self::Unavailable => 69,
            Self::Io => 74,
        }
    }

    /// One line: what happened.
    pub const fn title(self) -> &'static str {
        match self {
            Self::Internal => "something failed that should not have",
            Self::Usage => "the command line asks for something that makes no sense",
            Self::CellsOutside => "a checked number lies outside its accepted interval",
            Self::NotReproduced => "a run does not give again what it gave",
            Self::NoReconstruction => "no curve came out",
            Self::Suspect => "a curve came out, with reasons to doubt it",
            Self::NoOrder => "the pixels of a view could not be put in order",
            Self::NoMatch => "the two views could not be matched",
            Self::NoFit => "no 3D curve explains both views",
            Self::BadInput => "an input says something that cannot be used",
            Self::Calibration => "the calibration is no usable camera or pair of cameras",
            Self::SizeMismatch => {
                "parts of one view have different sizes, or points lie outside of its picture"
            }
            Self::TooLarge => "a file, or a size it declares, is larger than accepted",
            Self::Malformed => "a file breaks its format",
            Self::NotFinite => "a number is NaN or infinite",
            Self::Unsupported => "a file is valid but uses something that is not read here",
            Self::BadMask => "a mask holds no body that can be thinned",
            Self::NoInput => "something that is needed is not there",
            Self::NoPair => "there is no pair folder at that place",
            Self::Unavailable => "a part that is needed is not installed",
            Self::Io => "the operating system refused to read or write",
        }
    }

    /// Why it happens, and what to do.
    pub const fn explanation(self) -> &'static str {
        match self {
            Self::Internal => {
                "A step failed in a way that no input should bring about. Run again with -v, keep \
                 the input, and report both with `accurate --version`."
            }
            Self::Usage => {
                "Two options exclude each other, a list is empty, or a name stands for nothing. \
                 `accurate help COMMAND` shows every option with examples; close names are \
                 suggested."
            }
            Self::CellsOutside => {
                "`accurate table --check` measured a cell of the paper's table and found it \
                 outside the interval that the file accepts. The line that begins with FAIL says \
                 which. Either the code has changed what it computes, or the interval must be \
                 argued for anew."
            }
            Self::NotReproduced => {
                "`accurate verify` ran a recorded run again and got other bytes. The message names \
                 the files. If the binary's hash differs too, another version made the run; if the \
                 cases' hash differs, the generator has changed. On another processor or system \
                 image rows (a network's sums) and generated cases may differ in their last bits; \
                 `accurate reproduce table1 --image-cases 0` leaves the images out."
            }
            Self::NoReconstruction => {
                "The input was read, but no stage could make a curve of it. The message says which \
                 stage refused and with which number. A picture of the input usually shows why: an \
                 empty mask, two bodies, views of different moments."
            }
            Self::Suspect => {
                "With --strict a curve with reasons for doubt is a failure; the files are written \
                 all the same. The reasons stand in result.json under diagnostics.suspicions: an \
                 outline that stays unexplained, a second order of the strands that fits nearly as \
                 well, a large epipolar distance. Look at the picture or the report."
            }
            Self::NoOrder => {
                "The skeleton of a mask has no end, or too little of it could be reached. A closed \
                 curve has no end by nature. Stray pixels and gaps over 50 px break the published \
                 traversal; --method accurate bridges them. Ordered points of your own go in with \
                 --input points."
            }
            Self::NoMatch => {
                "No monotone pairing of the two curves makes sense under this calibration: usually \
                 the views are swapped, the extrinsics are inverted (camera to world instead of \
                 world to camera), or the pixels are not undistorted. `accurate camera doctor` tries \
                 these and more, and names the one. A 3x4 matrix times a negative number, as a DLT \
                 may give it, puts everything behind its camera: multiply it by -1."
            }
            Self::NoFit => {
                "A spline was fitted to both views and did not come out as a curve: too few points \
                 or outline, or views that show different bodies."
            }
            Self::BadInput => {
                "A value was read and makes no sense where it stands. The message names file, field \
                 and value."
            }
            Self::Calibration => {
                "K must be 3x3, upper triangular, with a non-zero diagonal (signs are free). RT is \
                 3x4 [R | t], world to camera: x_cam = R X + t, with R a rotation. Two cameras must \
                 not share their centre. `accurate camera show` prints what a file was taken for, \
                 docs/cameras.md says what each tool's file has to hold."
            }
            Self::SizeMismatch => {
                "Masks and images must have the size that the cameras were calibrated for, and both \
                 parts of a view the same size. A resized or cropped image needs its K changed with \
                 it. Ordered points are pixels of that image: a few may lie just beyond its edge (5 % \
                 of its longer side), others were seen in an image of another size."
            }
            Self::TooLarge => {
                "Sizes are checked before memory is taken, so that a small file cannot ask for all \
                 of it. The limit stands in the message."
            }
            Self::Malformed => {
                "The file does not follow its format. The message names the line or the byte where \
                 reading stopped."
            }
            Self::NotFinite => {
                "Every coordinate and calibration value must be a finite number. NaN often comes \
                 from an empty cell of a spreadsheet or a division in an export script."
            }
            Self::Unsupported => {
                "The file uses a variant that is not read here. The message says which; most tools \
                 can write the plainer one."
            }
            Self::BadMask => {
                "After thinning nothing is left that could be a thin body. Any non-zero pixel is \
                 foreground: check that the mask is not inverted, empty or a single blob."
            }
            Self::NoInput => {
                "A file that the chosen --input needs is missing. The message says where it was \
                 looked for; the layout of a pair folder is in docs/conventions.md."
            }
            Self::NoPair => {
                "A pair folder holds calibration/ and one of points/, masks/ or images/. A folder \
                 of case_* pair folders may be given as well."
            }
            Self::Unavailable => {
                "This build lacks a part, or a library that it loads at run time was not found. The \
                 message names it."
            }
            Self::Io => {
                "Reading or writing failed: no permission, no space, a broken medium, or a file where a \
                 folder has to be. Places are looked at before the work. Files are written whole or \
                 not at all, so nothing half-written is left."
            }
        }
    }
}

impl fmt::Display for Code {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for Code {
    type Err = UnknownName;

    fn from_str(name: &str) -> Result<Self, Self::Err> {
        Self::ALL.into_iter().find(|c| c.name().eq_ignore_ascii_case(name)).ok_or_else(|| {
            UnknownName {
                what: "code",
                name: name.to_owned(),
                expected: Self::ALL.map(Self::name).join(", "),
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_unique_and_find_their_code_again() {
        for code in Code::ALL {
            assert_eq!(code.name().parse::<Code>().unwrap(), code);
            assert_eq!(Code::ALL.iter().filter(|c| c.name() == code.name()).count(), 1);
        }
        assert!("A999".parse::<Code>().is_err());
    }
}
