//! throw-away
#![allow(clippy::unwrap_used, clippy::print_stdout)]
use accurate_synth::*;
use std::io::Write;
fn main() {
    let dir = std::env::args().nth(1).unwrap();
    for f in Family::ALL {
        let mut g = 0.0;
        let mut worst: f64 = 0.0;
        let mut r = 0.0;
        for i in 0..3 {
            let o = if i == 2 {
                CaseOptions { occlusion_discs: 1..=2, gaps: 1..=2, ..Default::default() }
            } else {
                CaseOptions::default()
            };
            let t = std::time::Instant::now();
            let c = generate(f, 1, i, &o).unwrap();
            let dt = t.elapsed().as_secs_f64() * 1e3;
            g += dt;
            worst = worst.max(dt);
            let t = std::time::Instant::now();
            let x = render_xray(&c, &XrayOptions::default());
            r += t.elapsed().as_secs_f64() * 1e3;
            println!(
                "{} len {:.1} n1 {} n2 {} r1 {} r2 {} t {:?} tang {:?}",
                c.id,
                c.length(),
                c.exact_points.0.len(),
                c.exact_points.1.len(),
                c.rounded_points.0.len(),
                c.rounded_points.1.len(),
                c.mask_thickness_px,
                c.tangent_stretches(5.0, 10.0).unwrap().map(|v| v.len())
            );
            for v in 0..2 {
                let (h, w) = x[v].dim();
                let mut o = std::fs::File::create(format!("{dir}/{}-{}.pgm", c.id, v + 1)).unwrap();
                write!(o, "P5\n{w} {h}\n255\n").unwrap();
                let b: Vec<u8> = x[v].iter().map(|v| (v >> 8) as u8).collect();
                o.write_all(&b).unwrap();
                let mut o =
                    std::fs::File::create(format!("{dir}/{}-{}-m.pgm", c.id, v + 1)).unwrap();
                write!(o, "P5\n{w} {h}\n255\n").unwrap();
                let b: Vec<u8> = c.masks[v].iter().map(|v| if *v { 255 } else { 0 }).collect();
                o.write_all(&b).unwrap();
            }
        }
        for i in 3..60 {
            let t = std::time::Instant::now();
            generate(f, 1, i, &CaseOptions::default()).unwrap();
            worst = worst.max(t.elapsed().as_secs_f64() * 1e3);
        }
        println!("{f}: gen {:.1} ms worst60 {worst:.1} ms, render {:.0} ms", g / 3.0, r / 3.0);
    }
}
