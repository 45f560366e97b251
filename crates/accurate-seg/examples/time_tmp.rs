#![allow(clippy::unwrap_used, clippy::print_stdout, missing_docs)]
fn main() {
    let b = std::fs::read("/tmp/seg/wire.bin").unwrap();
    let a = ndarray::Array2::from_shape_vec((1024, 1024), b).unwrap();
    let m = accurate_seg::Mask::from_u8(&a).unwrap();
    for f in [accurate_seg::zhang_suen, accurate_seg::guo_hall] {
        let mut t: Vec<f64> = (0..200)
            .map(|_| {
                let s = std::time::Instant::now();
                let r = f(&m);
                let e = s.elapsed().as_secs_f64();
                assert!(r.count() > 0);
                e * 1e3
            })
            .collect();
        t.sort_by(f64::total_cmp);
        println!(
            "min {:.3} median {:.3} ms, skeleton {} of {}",
            t[0],
            t[100],
            f(&m).count(),
            m.count()
        );
    }
    std::fs::write(
        "/tmp/seg/out.bin",
        accurate_seg::zhang_suen(&m).to_u8().into_raw_vec_and_offset().0,
    )
    .unwrap();
    let s = std::time::Instant::now();
    accurate_seg::distance_to_background(&m).unwrap();
    println!("dt {:.2} ms", s.elapsed().as_secs_f64() * 1e3);
    let img = a.mapv(f32::from);
    let s = std::time::Instant::now();
    accurate_seg::otsu_level(&img).unwrap();
    println!("otsu {:.2} ms", s.elapsed().as_secs_f64() * 1e3);
    let s = std::time::Instant::now();
    accurate_seg::Components::of(&m).unwrap();
    println!("cc {:.2} ms", s.elapsed().as_secs_f64() * 1e3);
}
