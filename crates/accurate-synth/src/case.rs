use accurate_geom::{Camera, GeomError, ImageSize, Pixel, Point3, Rig, View1, View2};
use ndarray::Array2;

use crate::polyline::{arc_lengths, resample};
use crate::projection::Projection;
use crate::tangency::stretches;
use crate::wires::Draft;
use crate::{
    CaseOptions, Disc, Family, SynthError, TangentStretch, case_rng, damage, mask, points, wires,
};

/// Number of points of every [`SynthCase::truth`].
pub const TRUTH_POINTS: usize = 2000;

/// Draws of curve and rig before a family counts as impossible; none needs more than a few dozen.
const MAX_DRAWS: u32 = 10_000;

/// One generated case: what a method is given, and the truth it is judged by.
#[derive(Debug, Clone, PartialEq)]
pub struct SynthCase {
    /// `<family>-<seed>-<index>`, the index with at least three digits.
    pub id: String,
    /// The family.
    pub family: Family,
    /// The seed of the set.
    pub seed: u64,
    /// The index of the case in its set.
    pub index: u64,
    /// The nominal rig: what a user is given. Differs from `true_rig` by the calibration error.
    pub rig: Rig,
    /// The rig that made the images.
    pub true_rig: Rig,
    /// The curve, as [`TRUTH_POINTS`] points uniform in arc length, ends included, in the rig's
    /// unit. Everything else in a case is exact for the polyline through these points.
    pub truth: Vec<Point3>,
    /// Sub-pixel projections about 1 px apart, ends included, in the order of the truth. The two
    /// views are sampled independently: equal indices are not the same point (see
    /// `exact_arc_lengths`). Missing stretches are left out.
    pub exact_points: (Vec<Pixel<View1>>, Vec<Pixel<View2>>),
    /// For each exact point the arc length, in the rig's unit, of the point of the truth it shows:
    /// the exact correspondence of the views.
    pub exact_arc_lengths: (Vec<f64>, Vec<f64>),
    /// The paper's protocol: truth points rounded to integer pixels through a z-buffer (each pixel
    /// keeps the nearest), visible ones in the order of the truth, one per pixel. Missing stretches
    /// are left out.
    pub rounded_points: (Vec<Pixel<View1>>, Vec<Pixel<View2>>),
    /// True where the pixel's centre is within half the mask thickness of the projected curve and
    /// not hidden; shape (height, width), one per view.
    pub masks: [Array2<bool>; 2],
    /// Thickness of each mask, px.
    pub mask_thickness_px: [f64; 2],
    /// Radius of the wire that the picture shows, in the rig's unit.
    pub wire_radius: f64,
    /// Discs that hide the wire in the mask and cover it in the picture, per view.
    pub occlusions: [Vec<Disc>; 2],
    /// Missing stretches per view: sorted, disjoint intervals of arc length in the image, px.
    pub gaps: [Vec<(f64, f64)>; 2],
}

/// Case `index` of the set `(family, seed)`.
///
/// Pure: the same arguments give the same case. Options do not change the curve or the true rig.
///
/// # Errors
/// [`SynthError::BadOption`] for an option out of range, [`SynthError::NoRoom`] if a disc or gap
/// does not fit between the tips, [`SynthError::NoDraw`] if no draw of 10,000 meets the family's
/// conditions (not known to happen).
///
/// # Source
/// `sim-paper`: the generator and the "ordered points" protocol of ACCURATE's simulation.
///
/// # Cost
/// A few milliseconds.
pub fn generate(
    family: Family,
    seed: u64,
    index: u64,
    options: &CaseOptions,
) -> Result<SynthCase, SynthError> {
    options.check()?;
    let rng = |stream: &str| case_rng(family, seed, index, stream);
    let (truth, projections, Draft { rig: true_rig, wire_radius, mask_diameter, .. }) =
        draw(family, seed, index)?;

    let cameras = [true_rig.camera1(), true_rig.camera2()];
    let mask_thickness_px = [0, 1].map(|v| {
        options.mask_thickness_px.unwrap_or_else(|| {
            let px_per_unit = cameras[v].k()[(0, 0)].abs() / projections[v].mean_depth();
            mask_diameter.map_or(3.0, |diameter| (diameter * px_per_unit).max(1.0))
        })
    });

    let mut view_gaps = [Vec::new(), Vec::new()];
    let mut discs = [Vec::new(), Vec::new()];
    for (v, projection) in projections.iter().enumerate() {
        let view = v as u8 + 1;
        view_gaps[v] = damage::gaps(&mut rng(&format!("gaps-{view}")), view, projection, options)?;
        discs[v] = damage::occlusions(
            &mut rng(&format!("occlusions-{view}")),
            view,
            projection,
            mask_thickness_px[v],
            options,
        )?;
    }

    let masks = [0, 1].map(|v| {
        let pieces: Vec<_> = projections[v]
            .visible(&view_gaps[v])
            .into_iter()
            .map(|(from, to)| projections[v].piece(from, to))
            .collect();
        mask::draw(cameras[v].size(), &pieces, mask_thickness_px[v], &discs[v])
    });

    let arc = arc_lengths(&truth);
    let (exact_1, arcs_1) = points::exact(&projections[0], &arc, &view_gaps[0]);
    let (exact_2, arcs_2) = points::exact(&projections[1], &arc, &view_gaps[1]);
    let rounded_points = (
        points::rounded(&projections[0], cameras[0].size(), &view_gaps[0]),
        points::rounded(&projections[1], cameras[1].size(), &view_gaps[1]),
    );

    let rig = match options.calibration_error {
        None => true_rig.clone(),
        Some(error) => Rig::new(
            true_rig.camera1().clone(),
            damage::miscalibrated(&mut rng("calibration"), true_rig.camera2(), error)?,
            true_rig.unit(),
        )?,
    };

    Ok(SynthCase {
        id: format!("{family}-{seed}-{index:03}"),
        family,
        seed,
        index,
        rig,
        true_rig,
        truth,
        exact_points: (exact_1, exact_2),
        exact_arc_lengths: (arcs_1, arcs_2),
        rounded_points,
        masks,
        mask_thickness_px,
        wire_radius,
        occlusions: discs,
        gaps: view_gaps,
    })
}

/// Draws until a curve meets its family's conditions.
fn draw(
    family: Family,
    seed: u64,
    index: u64,
) -> Result<(Vec<Point3>, [Projection; 2], Draft), SynthError> {
    let mut curve_rng = case_rng(family, seed, index, "curve");
    let mut rig_rng = case_rng(family, seed, index, "rig");
    for _ in 0..MAX_DRAWS {
        let draft = wires::draw(family, &mut curve_rng, &mut rig_rng)?;
        let truth = resample(&draft.curve, TRUTH_POINTS);
        let Some(projections) = project_inside(&draft, &truth)? else { continue };
        let accepted = match family {
            Family::Tangency => stretches(
                &draft.rig,
                &projections,
                wires::TANGENCY_MAX_ANGLE_DEG,
                wires::TANGENCY_MIN_LENGTH_PX,
            )?
            .iter()
            .any(|view| view.len() >= wires::TANGENCY_MIN_STRETCHES),
            _ => true,
        };
        if accepted {
            return Ok((truth, projections, draft));
        }
    }
    Err(SynthError::NoDraw { family: family.name(), seed, index, attempts: MAX_DRAWS })
}

/// Both projections, if they keep the family's margin to the image border and are no mere dots.
fn project_inside(draft: &Draft, truth: &[Point3]) -> Result<Option<[Projection; 2]>, GeomError> {
    let one = Projection::new(draft.rig.camera1(), truth)?;
    let two = Projection::new(draft.rig.camera2(), truth)?;
    let inside = |projection: &Projection, camera: &Camera| {
        let ImageSize { width, height } = camera.size();
        let (x_max, y_max) =
            (f64::from(width) - 1.0 - draft.margin_px, f64::from(height) - 1.0 - draft.margin_px);
        projection.points.iter().all(|p| {
            (draft.margin_px..=x_max).contains(&p.x) && (draft.margin_px..=y_max).contains(&p.y)
        })
    };
    let fits = inside(&one, draft.rig.camera1()) && inside(&two, draft.rig.camera2());
    Ok(fits.then_some([one, two]))
}

impl SynthCase {
    /// Arc length of the truth, in the rig's unit.
    pub fn length(&self) -> f64 {
        arc_lengths(&self.truth).last().copied().unwrap_or(0.0)
    }

    /// The point of the truth at arc length `s` (rig's unit; clamped to the ends). `None` if the
    /// truth has fewer than two points.
    ///
    /// # Cost
    /// O(points of the truth).
    pub fn truth_at(&self, s: f64) -> Option<Point3> {
        (self.truth.len() >= 2).then(|| points::at_arc(&self.truth, &arc_lengths(&self.truth), s))
    }

    /// Stretches of view 1 and view 2 of at least `min_length_px` whose direction is within
    /// `max_angle_deg` of the epipolar direction (true rig).
    ///
    /// # Errors
    /// [`SynthError::Geometry`] if the curve passes through an epipole.
    pub fn tangent_stretches(
        &self,
        max_angle_deg: f64,
        min_length_px: f64,
    ) -> Result<[Vec<TangentStretch>; 2], SynthError> {
        let projections = [
            Projection::new(self.true_rig.camera1(), &self.truth)?,
            Projection::new(self.true_rig.camera2(), &self.truth)?,
        ];
        Ok(stretches(&self.true_rig, &projections, max_angle_deg, min_length_px)?)
    }
}
