use std::path::Path;

use accurate_geom::LengthUnit;

use crate::IoError;

/// The unit that a file names under `field`. One that is not known is refused: a length in another
/// unit would be wrong by its factor.
pub(crate) fn length_unit(path: &Path, field: &str, label: &str) -> Result<LengthUnit, IoError> {
    label.parse().map_err(|_| IoError::field(path, field, label, "expected mm, cm, m or unit"))
}
