//! What a pair must be before any method looks at it.

use crate::{Error, InputKind, ViewPair};

/// Images were segmented, and what belongs to a view has one size.
pub(crate) fn require_usable(pair: &ViewPair, input: InputKind) -> Result<(), Error> {
    if input == InputKind::Image {
        require_segmented(pair)?;
    }
    require_one_size(pair)
}

/// Images have probability maps.
fn require_segmented(pair: &ViewPair) -> Result<(), Error> {
    match (&pair.images, &pair.probabilities) {
        (_, Some(_)) => Ok(()),
        (Some(_), None) => Err(Error::NotSegmented { case: pair.id.clone() }),
        (None, None) => Err(Error::MissingInput { case: pair.id.clone(), input: InputKind::Image }),
    }
}

/// What belongs to a view has the size of its camera's image.
fn require_one_size(pair: &ViewPair) -> Result<(), Error> {
    let cameras = [pair.rig.camera1(), pair.rig.camera2()];
    for (view, camera) in cameras.into_iter().enumerate() {
        let size = camera.size();
        let expected = (size.height as usize, size.width as usize);
        let found = [
            ("mask", pair.masks.as_ref().map(|both| both[view].dim())),
            ("image", pair.images.as_ref().map(|both| both[view].dim())),
            ("probability map", pair.probabilities.as_ref().map(|both| both[view].dim())),
        ];
        for (what, found) in found {
            if let Some(found) = found.filter(|found| *found != expected) {
                let (case, view) = (pair.id.clone(), view as u8 + 1);
                return Err(Error::OtherSize { case, view, what, found, expected });
            }
        }
    }
    Ok(())
}
