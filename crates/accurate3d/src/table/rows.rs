use crate::{InputKind, Method};

/// One line of the table before anything is measured.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// The method's name as printed.
    pub label: &'static str,
    /// What it reads.
    pub input: InputKind,
    /// Whether it uses the calibration.
    pub calibrated: bool,
    /// Row of the paper's Table 1 that it answers to, as named in `accurate_eval`'s published data.
    pub published: Option<&'static str>,
    /// What we run for it.
    pub outcome: Outcome,
}

/// Whether a row can be measured here.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// By this method of ours.
    Run(Method),
    /// Not here, for this reason: printed instead of a number, never a zero.
    NotAvailable(&'static str),
}

const NO_WEIGHTS: Outcome = Outcome::NotAvailable("no weights");

/// The rows of the paper's Table 1 in its order, each followed by our variants of the same method.
pub fn paper_rows() -> Vec<Row> {
    use InputKind::{Image, Mask, Points};
    use Outcome::Run;
    let row = |label, input, calibrated, published, outcome| Row {
        label,
        input,
        calibrated,
        published,
        outcome,
    };
    vec![
        row("VGGT", Mask, false, Some("vggt"), NO_WEIGHTS),
        row("Fast3R", Mask, false, Some("fast3r"), NO_WEIGHTS),
        row("MonSter", Mask, true, Some("monster"), NO_WEIGHTS),
        row("ACCURATE (paper)", Mask, true, Some("ours-mask"), Run(Method::Paper)),
        row("accurate (ours)", Mask, true, None, Run(Method::Accurate)),
        row("Baert et al., as tabled", Points, true, Some("baert"), Run(Method::BaertTable)),
        row("Baert et al., fair", Points, true, None, Run(Method::Baert)),
        row(
            "Hoffmann et al., as tabled",
            Points,
            true,
            Some("hoffmann"),
            Run(Method::HoffmannTable),
        ),
        row("Hoffmann et al., fair", Points, true, None, Run(Method::Hoffmann)),
        row("Baur et al., in its style", Points, true, None, Run(Method::Baur)),
        row("ACCURATE (paper)", Points, true, Some("ours-points"), Run(Method::Paper)),
        row("ACCURATE (paper, with R)", Points, true, None, Run(Method::PaperRefined)),
        row("accurate (ours)", Points, true, None, Run(Method::Accurate)),
        row("ACCURATE (paper)", Image, true, Some("ours-image"), Run(Method::Paper)),
        row("accurate (ours)", Image, true, None, Run(Method::Accurate)),
    ]
}
