use accurate_geom::nalgebra::Matrix3;
use accurate_geom::{LengthUnit, Pixel, Point3, View1, View2};
use accurate_io::{Column, CurveTable};
use accurate_match::CurvePoint;
use accurate_traverse::Trace;

use crate::robust::JointResult;
use crate::{Diagnostics, Explanation, InputKind, Method};

/// A reconstructed 3D curve: at least one point, all finite.
#[derive(Debug, Clone, PartialEq)]
pub struct Reconstruction {
    /// Name of the case.
    pub id: String,
    /// The method that made it.
    pub method: Method,
    /// What it was made from.
    pub input: InputKind,
    /// Unit of the positions.
    pub unit: LengthUnit,
    /// Points in order along the body, with the pixels they came from.
    pub points: Vec<CurvePoint>,
    /// Covariance of each point, squared [`Reconstruction::unit`], where the method gives one. Right
    /// topology and the stated calibration are taken for granted.
    pub covariances: Option<Vec<Matrix3<f64>>>,
    /// For each point whether the curve runs along an epipolar line there, in either view: its
    /// depth is carried over from its neighbours rather than seen.
    pub along_epipolar_line: Vec<bool>,
    /// The ordered curves that were matched.
    pub traces: Traces,
    /// How far the result can be trusted.
    pub diagnostics: Diagnostics,
    /// What was considered and decided.
    pub explanation: Explanation,
}

impl Reconstruction {
    /// The positions alone, in order.
    pub fn positions(&self) -> Vec<Point3> {
        self.points.iter().map(|p| p.position).collect()
    }

    /// Length of the polyline through the points, in [`Reconstruction::unit`].
    pub fn length(&self) -> f64 {
        self.points.windows(2).map(|w| (w[1].position - w[0].position).norm()).sum()
    }

    /// Stretches that run along an epipolar line in a view, as arc lengths from the begin: their depth
    /// is weakly seen.
    pub fn weak_stretches(&self) -> Vec<[f64; 2]> {
        let arc = self.arc_lengths();
        let mut stretches: Vec<[f64; 2]> = Vec::new();
        let mut open = false;
        for (weak, s) in self.along_epipolar_line.iter().zip(arc) {
            match (weak, open, stretches.last_mut()) {
                (true, true, Some(last)) => last[1] = s,
                (true, ..) => stretches.push([s, s]),
                _ => {}
            }
            open = *weak;
        }
        stretches
    }

    fn arc_lengths(&self) -> Vec<f64> {
        let mut travelled = 0.0;
        let mut arc_lengths = Vec::with_capacity(self.points.len());
        for (i, point) in self.points.iter().enumerate() {
            if i > 0 {
                travelled += (point.position - self.points[i - 1].position).norm();
            }
            arc_lengths.push(travelled);
        }
        arc_lengths
    }

    /// The curve with its per-point columns, ready for any curve file.
    pub fn curve_table(&self) -> CurveTable {
        let column = |name: &str, unit: &str, value: fn(&CurvePoint) -> f64| Column {
            name: name.to_owned(),
            unit: unit.to_owned(),
            values: self.points.iter().map(value).collect(),
        };
        let arc_length = Column {
            name: "arc_length".to_owned(),
            unit: self.unit.label().to_owned(),
            values: self.arc_lengths(),
        };
        let flags = self.along_epipolar_line.iter().map(|f| f64::from(u8::from(*f))).collect();
        let mut columns = vec![
            arc_length,
            column("epipolar_distance_px", "px", |p| p.epipolar_distance_px),
            column("x1_px", "px", |p| p.pixel1.x),
            column("y1_px", "px", |p| p.pixel1.y),
            column("x2_px", "px", |p| p.pixel2.x),
            column("y2_px", "px", |p| p.pixel2.y),
            Column { name: "along_epipolar_line".to_owned(), unit: String::new(), values: flags },
        ];
        columns.extend(self.uncertainty_columns());
        CurveTable { unit: self.unit, points: self.positions(), columns }
    }

    /// The largest standard deviation of each point across the curve, in the rig's unit, if the method gives
    /// an uncertainty: where a point lies along it is a matter of parametrisation, and moves no curve.
    pub fn sigmas_across(&self) -> Option<Vec<f64>> {
        self.covariances.as_ref().map(|list| sigmas_across(&self.positions(), list))
    }

    /// `sigma`, the largest standard deviation in any direction, `sigma_across`, and the covariance's six
    /// entries.
    fn uncertainty_columns(&self) -> Vec<Column> {
        let Some(covariances) = &self.covariances else { return Vec::new() };
        let unit = self.unit.label();
        let column = |name: &str, unit: String, value: &dyn Fn(&Matrix3<f64>) -> f64| Column {
            name: name.to_owned(),
            unit,
            values: covariances.iter().map(value).collect(),
        };
        let mut columns = vec![column("sigma", unit.to_owned(), &largest_sigma)];
        columns.extend(self.sigmas_across().map(|values| Column {
            name: "sigma_across".to_owned(),
            unit: unit.to_owned(),
            values,
        }));
        for (name, row, col) in [
            ("cov_xx", 0, 0),
            ("cov_xy", 0, 1),
            ("cov_xz", 0, 2),
            ("cov_yy", 1, 1),
            ("cov_yz", 1, 2),
            ("cov_zz", 2, 2),
        ] {
            columns.push(column(name, format!("{unit}^2"), &|c| c[(row, col)]));
        }
        columns
    }
}

/// The largest standard deviation of each point across the curve, in the points' unit.
pub(crate) fn sigmas_across(points: &[Point3], covariances: &[Matrix3<f64>]) -> Vec<f64> {
    let of = |(i, covariance)| sigma_across(points, i, covariance);
    covariances.iter().enumerate().map(of).collect()
}

fn sigma_across(points: &[Point3], i: usize, covariance: &Matrix3<f64>) -> f64 {
    let (before, after) = (i.saturating_sub(1), (i + 1).min(points.len() - 1));
    match (points[after] - points[before]).try_normalize(0.0) {
        Some(along) => {
            let across = Matrix3::identity() - along * along.transpose();
            largest_sigma(&(across * covariance * across))
        }
        None => largest_sigma(covariance),
    }
}

/// Square root of the largest eigenvalue.
fn largest_sigma(covariance: &Matrix3<f64>) -> f64 {
    covariance.symmetric_eigenvalues().max().max(0.0).sqrt()
}

/// The ordered curves of both views, and what of the skeletons they left out.
#[derive(Debug, Clone, PartialEq)]
pub struct Traces {
    /// Ordered pixels of view 1.
    pub points1: Vec<Pixel<View1>>,
    /// Ordered pixels of view 2.
    pub points2: Vec<Pixel<View2>>,
    /// Fraction of each view's skeleton that the trace passes, 1 where the points were given.
    pub coverage: [f64; 2],
    /// Steps longer than 3 px in each view's trace, 0 where the points were given.
    pub jumps: [usize; 2],
    /// Whether the points of view 2 were given against those of view 1, and turned round.
    pub view2_reversed: bool,
}

impl Traces {
    /// Curves that were given in order; `reversed` turns that of view 2 round.
    pub(crate) fn given(
        points1: Vec<Pixel<View1>>,
        mut points2: Vec<Pixel<View2>>,
        reversed: bool,
    ) -> Self {
        if reversed {
            points2.reverse();
        }
        Self { points1, points2, coverage: [1.0; 2], jumps: [0; 2], view2_reversed: reversed }
    }

    /// Walks that the joint choice settled on.
    pub(crate) fn walked(result: JointResult) -> Self {
        Self {
            points1: result.walk1,
            points2: result.walk2,
            coverage: result.coverage,
            jumps: [0; 2],
            view2_reversed: false,
        }
    }

    /// Curves that were traced from skeletons.
    pub(crate) fn traced(trace1: Trace<View1>, trace2: Trace<View2>) -> Self {
        Self {
            coverage: [trace1.coverage, trace2.coverage],
            jumps: [trace1.jumps.len(), trace2.jumps.len()],
            points1: trace1.points,
            points2: trace2.points,
            view2_reversed: false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_moves_points_along_the_curve_is_no_uncertainty_of_it() {
        let line = [0.0, 1.0, 2.0].map(|x| Point3::new(x, 0.0, 0.0));
        let covariance = Matrix3::from_diagonal(&[100.0, 4.0, 1.0].into());
        for i in 0..3 {
            assert!((sigma_across(&line, i, &covariance) - 2.0).abs() < 1e-12);
        }
        assert!((sigma_across(&line[..1], 0, &covariance) - 10.0).abs() < 1e-12);
    }
}
