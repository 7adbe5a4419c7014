//! What a bake costs and how exact it is.
#![expect(clippy::print_stdout, reason = "a bench prints")]
use kiln_bake::*;
use kiln_image::*;
use std::time::Instant;

fn cpu_s() -> f64 {
    let mut ns = 0.0;
    for task in std::fs::read_dir("/proc/self/task").unwrap() {
        let text = std::fs::read_to_string(task.unwrap().path().join("schedstat")).unwrap_or_default();
        ns += text.split(' ').next().and_then(|x| x.parse::<f64>().ok()).unwrap_or(0.0);
    }
    ns * 1e-9
}

fn timed<T>(what: &str, mut f: impl FnMut() -> T) -> T {
    let mut best: Vec<(f64, f64)> = Vec::new();
    let mut out = None;
    for _ in 0..3 {
        let (c, w) = (cpu_s(), Instant::now());
        out = Some(f());
        best.push((cpu_s() - c, w.elapsed().as_secs_f64()));
    }
    best.sort_by(|a, b| a.0.total_cmp(&b.0));
    println!("{what:40} cpu {:8.1} ms  wall {:8.1} ms", best[1].0 * 1e3, best[1].1 * 1e3);
    out.unwrap()
}

fn main() {
    let args: Vec<String> = std::env::args().collect();
    if args[1] == "accuracy" {
        return accuracy(args[2].parse().unwrap(), &args[3..]);
    }
    let file = args[1].clone();
    let error: f64 = args[2].parse().unwrap();
    let n = Cancel::NEVER;
    let bytes = std::fs::read(&file).unwrap();
    let decoded = timed("decode", || decode(&bytes, &Limits::default(), n).unwrap());
    let p = Panorama::new(decoded.image).unwrap();
    println!("{}x{}", p.width(), p.height());
    let request = AnalysisRequest { alpha_min: 1.0 / 64.0, sheen_alpha_min: None, error };
    let a = timed("analyse", || analyse(&p, &request, n).unwrap());
    println!("L {}", a.band_limit());
    if args.len() > 4 {
        for _ in 0..20 {
            analyse(&p, &request, n).unwrap();
        }
        return;
    }
    let size: usize = args.get(3).map_or(256, |x| x.parse().unwrap());
    let count = size.ilog2();
    let (c0, w0) = (cpu_s(), Instant::now());
    let force = timed("brute force", || BruteForce::new(&p, n).unwrap());
    for level in 1..=count {
        let r = level as f64 / f64::from(count);
        let m = timed(&format!("specular {level}"), || specular_level(&a, r * r, size >> level, n).unwrap());
        println!("   {:?}", m.accuracy);
        let m = timed("   measure", || force.measure(&m.cube, Lobe::Ggx { alpha: r * r }, n).unwrap());
        println!("   {m:?}");
    }
    timed("irradiance 64", || irradiance(&a, 64, n).unwrap());
    timed("sh", || sh(&a, 2));
    timed("skybox", || skybox(&p, size, n).unwrap());
    println!("total cpu {} wall {}", cpu_s() - c0, w0.elapsed().as_secs_f64());
}

fn accuracy(error: f64, files: &[String]) {
    let n = Cancel::NEVER;
    for file in files {
        let bytes = std::fs::read(file).unwrap();
        let decoded = decode(&bytes, &Limits::default(), n).unwrap();
        let mut image = decoded.image;
        TexelPolicy::Repair.apply(&mut image, n).unwrap();
        let p = Panorama::new(image).unwrap();
        let (c0, w0) = (cpu_s(), Instant::now());
        let request = AnalysisRequest { alpha_min: 1.0 / 64.0, sheen_alpha_min: Some(0.0625), error };
        let a = analyse(&p, &request, n).unwrap();
        println!(
            "{file} L {} cpu {:.3} wall {:.3}",
            a.band_limit(),
            cpu_s() - c0,
            w0.elapsed().as_secs_f64()
        );
        let force = BruteForce::new(&p, n).unwrap();
        let show = |what: &str, m: Prefiltered, lobe: Lobe| {
            let f = force.measure(&m.cube, lobe, n).unwrap();
            let flag = if f.rms > 1e-4 || f.largest > 1e-2 { "  <<<" } else { "" };
            println!(
                "  {what:10} L {:5} bound {:.1e} rms {:.1e} largest {:.1e} clamp {:.1e} at {:.2?}{flag}",
                m.accuracy.band_limit,
                m.accuracy.rms_bound,
                f.rms,
                f.largest,
                m.accuracy.clamped_flux,
                f.worst
            );
        };
        for level in 1..=8 {
            let alpha = (level as f64 / 8.0f64).powi(2);
            show(
                &format!("ggx {level}"),
                specular_level(&a, alpha, 256 >> level, n).unwrap(),
                Lobe::Ggx { alpha },
            );
        }
        show("lambert", irradiance(&a, 64, n).unwrap(), Lobe::Lambert);
        for level in [2, 4, 6, 8] {
            let alpha = (level as f64 / 8.0f64).powi(2);
            show(
                &format!("charlie {level}"),
                sheen_level(&a, alpha, 256 >> level, n).unwrap(),
                Lobe::Charlie { alpha },
            );
        }
    }
}
