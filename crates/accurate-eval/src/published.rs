use std::sync::LazyLock;

use accurate_geom::LengthUnit;

use crate::TableScores;

/// A data set of the paper's Table 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Dataset {
    /// The simulated curves. **The table heads these columns "pixel", but their numbers are in the
    /// world unit of the simulator, about 10 image pixels.**
    Simulation,
    /// The vessel phantom, mm.
    Phantom,
}

impl Dataset {
    /// Both, in the order of the table.
    pub const ALL: [Self; 2] = [Self::Simulation, Self::Phantom];

    /// `simulation` or `phantom`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Simulation => "simulation",
            Self::Phantom => "phantom",
        }
    }

    /// The unit the numbers are in.
    pub const fn unit(self) -> LengthUnit {
        match self {
            Self::Simulation => LengthUnit::Unit,
            Self::Phantom => LengthUnit::Millimetre,
        }
    }
}

/// A column of the paper's Table 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Metric {
    /// Acc.
    Accuracy,
    /// Comp.
    Completeness,
    /// Overall.
    Overall,
    /// Max Err.
    MaxError,
}

impl Metric {
    /// All four, in the order of the table.
    pub const ALL: [Self; 4] = [Self::Accuracy, Self::Completeness, Self::Overall, Self::MaxError];

    /// `accuracy`, `completeness`, `overall` or `max_error`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Accuracy => "accuracy",
            Self::Completeness => "completeness",
            Self::Overall => "overall",
            Self::MaxError => "max_error",
        }
    }

    /// The heading of the table.
    pub const fn heading(self) -> &'static str {
        match self {
            Self::Accuracy => "Acc.",
            Self::Completeness => "Comp.",
            Self::Overall => "Overall",
            Self::MaxError => "Max Err.",
        }
    }

    /// The number of this column.
    pub const fn of(self, scores: &TableScores) -> f64 {
        match self {
            Self::Accuracy => scores.accuracy,
            Self::Completeness => scores.completeness,
            Self::Overall => scores.overall,
            Self::MaxError => scores.max_error,
        }
    }
}

/// What a method of the table was given.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum PublishedInput {
    /// Ground-truth masks.
    Mask,
    /// Ordered ground-truth points.
    Points,
    /// Raw images.
    Image,
}

/// One row of the paper's Table 1 on one data set.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PublishedRow {
    /// `vggt`, `fast3r`, `monster`, `ours-mask`, `baert`, `hoffmann`, `ours-points` or `ours-image`.
    pub id: &'static str,
    /// The method as printed.
    pub method: &'static str,
    /// What it was given.
    pub input: PublishedInput,
    /// Whether it used the calibration (Calib.).
    pub calibrated: bool,
    /// The data set.
    pub dataset: Dataset,
    /// The four numbers as printed, to four decimals, in [`Dataset::unit`].
    pub scores: TableScores,
}

/// One published number.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PublishedCell {
    /// Its row.
    pub row: PublishedRow,
    /// Its column.
    pub metric: Metric,
    /// The number as printed.
    pub value: f64,
}

/// The ids of the eight rows, in the order of the table.
pub const PUBLISHED_ROWS: [&str; 8] =
    ["vggt", "fast3r", "monster", "ours-mask", "baert", "hoffmann", "ours-points", "ours-image"];

/// The paper's Table 1: eight rows on two data sets, in the order of the table, the simulation
/// before the phantom.
///
/// # Source
/// ACCURATE, Table 1.
pub fn published_table() -> &'static [PublishedRow] {
    static TABLE: LazyLock<Vec<PublishedRow>> = LazyLock::new(|| {
        // A test holds that no line is lost here.
        include_str!("../data/table1.csv").lines().skip(1).filter_map(parse).collect()
    });
    &TABLE
}

/// One row of the table by its id, or `None` if there is no such id.
pub fn published(id: &str, dataset: Dataset) -> Option<&'static PublishedRow> {
    published_table().iter().find(|row| row.id == id && row.dataset == dataset)
}

/// All 64 published numbers, in the order of [`published_table`] and [`Metric::ALL`].
pub fn published_cells() -> impl Iterator<Item = PublishedCell> {
    published_table().iter().flat_map(|row| {
        Metric::ALL.map(|metric| PublishedCell { row: *row, metric, value: metric.of(&row.scores) })
    })
}

fn parse(line: &'static str) -> Option<PublishedRow> {
    let fields: Vec<&'static str> = line.split(',').collect();
    let [id, method, input, calibrated, dataset, numbers @ ..] = &fields[..] else { return None };
    let [accuracy, completeness, overall, max_error] = numbers else { return None };
    Some(PublishedRow {
        id,
        method,
        input: match *input {
            "mask" => PublishedInput::Mask,
            "points" => PublishedInput::Points,
            "image" => PublishedInput::Image,
            _ => return None,
        },
        calibrated: match *calibrated {
            "yes" => true,
            "no" => false,
            _ => return None,
        },
        dataset: Dataset::ALL.into_iter().find(|d| d.name() == *dataset)?,
        scores: TableScores {
            accuracy: accuracy.parse().ok()?,
            completeness: completeness.parse().ok()?,
            overall: overall.parse().ok()?,
            max_error: max_error.parse().ok()?,
        },
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_row_of_the_table_is_there_in_order() {
        let ids: Vec<&str> = published_table().iter().map(|row| row.id).collect();
        let expected: Vec<&str> = PUBLISHED_ROWS.iter().flat_map(|id| [*id, *id]).collect();
        assert_eq!(ids, expected);
        assert_eq!(published_cells().count(), 64);
        let data = include_str!("../data/table1.csv");
        assert_eq!(data.lines().count(), published_table().len() + 1);
    }

    #[test]
    fn published_overall_is_the_mean_of_accuracy_and_completeness_to_rounding() {
        // Three numbers rounded to four decimals: 0.5e-4 of the mean, 0.5e-4 of the result.
        let tolerance = 1.0e-4 + 16.0 * f64::EPSILON * 20.0;
        for row in published_table() {
            let TableScores { accuracy, completeness, overall, max_error } = row.scores;
            assert!((overall - (accuracy + completeness) / 2.0).abs() <= tolerance, "{row:?}");
            assert!(max_error > completeness, "{row:?}");
        }
    }

    #[test]
    fn cells_are_found_by_name() {
        let row = published("ours-points", Dataset::Simulation).unwrap();
        assert_eq!(Metric::Overall.of(&row.scores), 0.0659);
        assert_eq!((row.input, row.calibrated), (PublishedInput::Points, true));
        assert_eq!(published("monster", Dataset::Phantom).unwrap().scores.max_error, 14.6172);
        assert!(published("nobody", Dataset::Phantom).is_none());
        assert!(!published("vggt", Dataset::Simulation).unwrap().calibrated);
    }
}
