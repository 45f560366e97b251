//! throw-away
#![allow(clippy::unwrap_used, clippy::print_stdout)]
use accurate_geom::*;
use accurate_synth::*;
fn main() {
    let seeds: u64 = std::env::args().nth(1).unwrap().parse().unwrap();
    for seed in 1..=seeds {
        let mut m = [0.0; 4];
        for i in 0..26 {
            let c = generate(Family::SimPaper, seed, i, &CaseOptions::default()).unwrap();
            let (a, b) = &c.rounded_points;
            let f = c.rig.fundamental();
            let lines: Vec<_> = b.iter().map(|p| f.line(*p).unwrap()).collect();
            let (n, k) = (a.len(), b.len());
            let mut cost = vec![0f64; n * k];
            for i in 0..n { for j in 0..k {
                let d = lines[j].distance(a[i]);
                let best = if i == 0 && j == 0 { 0.0 } else {
                    let mut x = f64::INFINITY;
                    if i > 0 { x = x.min(cost[(i-1)*k+j]); }
                    if j > 0 { x = x.min(cost[i*k+j-1]); }
                    if i > 0 && j > 0 { x = x.min(cost[(i-1)*k+j-1]); }
                    x };
                cost[i*k+j] = d + best;
            }}
            let (mut i1, mut j1) = (n-1, k-1);
            let mut pts = vec![];
            let (p1, p2) = (c.rig.camera1(), c.rig.camera2());
            loop {
                // midpoint
                let (o1, o2) = (p1.centre(), p2.centre());
                let (r1, r2) = (p1.ray(&a[i1].point()), p2.ray(&b[j1].point()));
                let w = o2 - o1;
                let (aa, bb, cc, dd, ee) = (r1.dot(&r1), r1.dot(&r2), r2.dot(&r2), r1.dot(&w), r2.dot(&w));
                let den = aa*cc - bb*bb;
                let (s, t) = ((cc*dd - bb*ee)/den, (bb*dd - aa*ee)/den);
                pts.push(Point3::from(((o1 + r1*s).coords + (o2 + r2*t).coords)/2.0));
                if i1 == 0 && j1 == 0 { break; }
                let up = if i1 > 0 { cost[(i1-1)*k+j1] } else { f64::INFINITY };
                let le = if j1 > 0 { cost[i1*k+j1-1] } else { f64::INFINITY };
                let di = if i1 > 0 && j1 > 0 { cost[(i1-1)*k+j1-1] } else { f64::INFINITY };
                let x = up.min(le).min(di);
                if up == x { i1 -= 1 } else if le == x { j1 -= 1 } else { i1 -= 1; j1 -= 1 }
            }
            let near = |x: &Vec<Point3>, y: &Vec<Point3>| -> (f64, f64) {
                let d: Vec<f64> = x.iter().map(|p| y.iter().map(|q| (p-q).norm_squared()).fold(f64::INFINITY, f64::min).sqrt()).collect();
                (d.iter().sum::<f64>() / d.len() as f64, d.iter().cloned().fold(0.0, f64::max))
            };
            let (acc, _) = near(&pts, &c.truth);
            let (comp, max) = near(&c.truth, &pts);
            m[0] += acc; m[1] += comp; m[2] += (acc+comp)/2.0; m[3] += max;
        }
        println!("seed {seed}: Acc {:.4} Comp {:.4} Overall {:.4} Max {:.3}", m[0]/26.0, m[1]/26.0, m[2]/26.0, m[3]/26.0);
    }
}
