//! scratch
use hal_sim::*;
#[test]
fn probe() {
    let id = std::env::var("EFFECT").ok();
    let seed = std::env::var("SEED").ok().and_then(|s| s.parse().ok()).unwrap_or(1);
    let s = Scenario::demo(seed, id.as_deref()).unwrap();
    println!("{:?}", s.effects);
    let t = std::time::Instant::now();
    let r = run(&s, None, &mut |_| ()).unwrap();
    let dt = t.elapsed().as_secs_f64();
    println!(
        "{} samples, {:.3} s, {:.0}x; link {:?} events {}",
        r.samples.len(),
        dt,
        (s.run_s() + 12.0) / dt,
        r.link,
        r.events.len()
    );
    let rows: Vec<_> = r.converted().collect();
    let f = |o: Option<f64>| o.map_or("--".into(), |v| format!("{v:.4}"));
    for (k, c) in rows.iter().enumerate() {
        if k % 80 == 70 || k < 3 {
            let t = r.truth[k].plant;
            println!(
                "{:.1} {} | {:.2} {} {} {} {} | {:.4} {} {} | {} {} {} {}",
                c.t_s,
                c.pulse_us,
                t.rpm,
                f(c.rpm[0]),
                f(c.rpm[1]),
                f(c.rpm[2]),
                f(c.rpm[3]),
                t.thrust_n,
                f(c.adc[0]),
                f(c.thrust_rms_n),
                f(c.adc[1]),
                f(c.adc[2]),
                f(c.adc[3]),
                f(c.adc[4])
            );
        }
    }
}
