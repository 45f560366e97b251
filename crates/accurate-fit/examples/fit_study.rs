//! scratch
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::print_stdout)]
use accurate_fit::*;
use accurate_geom::*;
use accurate_synth::*;
use std::time::Instant;

pub fn to_polyline(p: &Point3, line: &[Point3]) -> f64 {
    let mut best = f64::INFINITY;
    for w in line.windows(2) {
        let e = w[1] - w[0];
        let t = ((p - w[0]).dot(&e) / e.norm_squared().max(1e-300)).clamp(0.0, 1.0);
        best = best.min((p - w[0] - e * t).norm_squared());
    }
    best.sqrt()
}
pub fn compare(curve: &[Point3], truth: &[Point3]) -> (f64, f64) {
    let a: Vec<f64> = curve.iter().map(|p| to_polyline(p, truth)).collect();
    let b: Vec<f64> = truth.iter().step_by(2).map(|p| to_polyline(p, curve)).collect();
    let mean = |v: &[f64]| v.iter().sum::<f64>() / v.len() as f64;
    let max = a.iter().chain(&b).cloned().fold(0.0, f64::max);
    (0.5 * (mean(&a) + mean(&b)), max)
}
fn stats(v: &mut Vec<f64>) -> (f64, f64, f64) {
    v.sort_by(f64::total_cmp);
    (v.iter().sum::<f64>() / v.len() as f64, v[v.len() / 2], v[(v.len() as f64 * 0.95) as usize])
}
fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let get = |k: &str, d: &str| {
        args.iter().find_map(|a| a.strip_prefix(&format!("{k}="))).unwrap_or(d).to_string()
    };
    let n: u64 = get("n", "20").parse().unwrap();
    let seed: u64 = get("seed", "1001").parse().unwrap();
    let verbose = get("v", "0") == "1";
    let noise: f64 = get("noise", "0").parse().unwrap();
    let mut options = CaseOptions::default();
    if let Ok(t) = get("t", "").parse() {
        options.mask_thickness_px = Some(t);
    }
    if get("discs", "") != "" {
        options.occlusion_discs = 1..=2;
    }
    let mut params = if get("mode", "plain") == "plain" {
        OutlineFitParams::DEFAULT
    } else {
        OutlineFitParams::ANNEALED
    };
    macro_rules! p { ($($f:ident),*) => { $( if let Ok(v) = get(stringify!($f), "").parse() { params.$f = v; } )* } }
    p!(
        knot_spacing_px,
        lambda2,
        lambda3,
        lambda3_start,
        iterations,
        cauchy_scale_px,
        cauchy_scale_start_px,
        reach_px,
        reach_start_px,
        subsample,
        outside_weight,
        damping,
        tolerance
    );
    for family in get("families", "easy,medium,hard,helix,carm,sim-paper").split(',') {
        let family: Family = family.parse().unwrap();
        let (mut o, mut m, mut un, mut off, mut chi, mut ms, mut steps, mut ho) =
            (vec![], vec![], vec![], vec![], vec![], vec![], vec![], vec![]);
        for index in 0..n {
            let case = generate(family, seed, index, &options).unwrap();
            let one = Outline::<View1>::from_mask(case.masks[0].view()).unwrap();
            let two = Outline::<View2>::from_mask(case.masks[1].view()).unwrap();
            let length: f64 = case.truth.windows(2).map(|w| (w[1] - w[0]).norm()).sum();
            // start: truth with smooth perturbation
            let f = 1.0 + 0.0 * length;
            let cam = case.rig.camera1();
            let ppu = cam.k()[(0, 0)].abs() / cam.depth(&case.truth[0]) * f;
            let start: Vec<Point3> = case
                .truth
                .iter()
                .enumerate()
                .map(|(k, p)| {
                    let s = k as f64 / 2000.0 * length * ppu;
                    let a = noise / ppu;
                    Point3::new(
                        p.x + a * (s / 17.0).sin(),
                        p.y + a * (s / 23.0 + 1.0).sin(),
                        p.z + a * (s / 29.0 + 2.0).sin(),
                    )
                })
                .collect();
            let curve = Curve3::interpolate(
                &start.iter().step_by(20).chain(start.last()).cloned().collect::<Vec<_>>(),
            )
            .unwrap();
            let t0 = Instant::now();
            let pair = OutlinePair::new(&one, &two);
            let rounds: usize = get("rounds", "0").parse().unwrap();
            let mut ap = AdaptiveParams::DEFAULT;
            ap.rounds = rounds;
            if let Ok(v) = get("window", "").parse() {
                ap.window_px = v;
            }
            if let Ok(v) = get("var", "").parse() {
                ap.noise_inflation = v;
            }
            let fit = if rounds == 0 {
                fit_outlines(&curve, &pair, &case.rig, &params).unwrap()
            } else {
                fit_outlines_adaptively(&curve, &pair, &case.rig, &params, &ap).unwrap()
            };
            let dt = t0.elapsed().as_secs_f64() * 1e3;
            let pts = fit.curve.sample(1500);
            let (ov, mx) = compare(&pts, &case.truth);
            let j = fit.judgement;
            if verbose {
                println!(
                    "{} O {:.3} M {:.3} un {:.3} off {:.3} chi {:.4} h {:?} truth t {:?} steps {} conv {} used {:?}/{:?} bend {:.2} {:.1} ms",
                    case.id,
                    ov,
                    mx,
                    j.unexplained,
                    j.outside,
                    j.chi_per_point(),
                    fit.half_thickness_px,
                    case.mask_thickness_px,
                    fit.steps,
                    fit.converged,
                    j.used,
                    j.points,
                    j.bending,
                    dt
                );
            }
            o.push(ov);
            m.push(mx);
            un.push(j.unexplained);
            off.push(j.outside);
            chi.push(j.chi_per_point());
            ms.push(dt);
            steps.push(fit.steps as f64);
            ho.push(fit.half_thickness_px[0] - case.mask_thickness_px[0] / 2.0);
        }
        let s = stats;
        let (o, m, un, off, chi, ms, st, ho) = (
            s(&mut o),
            s(&mut m),
            s(&mut un),
            s(&mut off),
            s(&mut chi),
            s(&mut ms),
            s(&mut steps),
            s(&mut ho),
        );
        println!(
            "{family:10} Overall {:.4}/{:.4} Max {:.3}/{:.3}/p95 {:.3} | un {:.3} p95 {:.3} off {:.3} chi {:.4} p95 {:.4} dh {:.3} steps {:.1} ms {:.2}",
            o.0, o.1, m.0, m.1, m.2, un.0, un.2, off.0, chi.0, chi.2, ho.0, st.0, ms.0
        );
    }
}
