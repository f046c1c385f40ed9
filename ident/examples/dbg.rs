#![allow(missing_docs, clippy::all)]
//! dbg
use ident::context::Context;
use ident::diagnose::*;
use ident::effects;
use ident::heldout;
use ident::hypothesis::*;
use ident::log::Log;
use ident::search::*;
fn show(c: &Context, d: Declared, f: &Fit, start: &Fit, folds: &[Vec<bool>], before: &[heldout::Held]) {
    let h = heldout::errors(c, d, f, folds);
    for (k, p) in f.placed.iter().enumerate() {
        println!("   {p:?}");
        for e in f.estimates(c, d, k) {
            println!("        {} {:.5} +- {:.5} {}", e.name, e.value, e.se, e.unit);
        }
    }
    for (i, t) in c.targets.iter().enumerate() {
        println!(
            "   {:24} floor {:.5} loglik gain {:.1} share {:.2} held {:.5} -> {:.5} typ {:.5} -> {:.5}",
            t.name,
            t.noise.rms,
            f.targets[i].loglik.mean - start.targets[i].loglik.mean,
            f.targets[i].share,
            before[i].rms,
            h[i].rms,
            before[i].typical,
            h[i].typical
        );
    }
}
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let bytes = std::fs::read(&a[1]).unwrap();
    let log = Log::parse("x", &bytes[..]).unwrap();
    let c = Context::new(&log, None);
    let d = Declared::default();
    let start = fit(&c, d, &[], None, Rows::All).unwrap();
    let folds = heldout::folds(&c);
    let before = heldout::errors(&c, d, &start, &folds);
    if a.len() > 2 {
        let mut placed: Vec<Placed> = vec![];
        let loud = vec![true; c.targets.len()];
        for id in a[2].split(',') {
            let (id, chan) = id.split_once('@').unwrap_or((id, ""));
            let mut best: Option<(f64, Vec<Placed>)> = None;
            for e in effects::library().iter().filter(|e| e.id() == id) {
                for inst in e.instances(&c) {
                    if !chan.is_empty() && inst.channels[0] != chan {
                        continue;
                    }
                    if let Some((shape, g)) = scan(&c, d, &placed, *e, &inst, &loud) {
                        let mut p = placed.clone();
                        p.push(Placed { effect: *e, instance: inst.clone(), shape });
                        println!("  scan {id} {:?} {} gain {g:.1}", inst.channels, inst.form);
                        if best.as_ref().is_none_or(|b| g > b.0) {
                            best = Some((g, p));
                        }
                    }
                }
            }
            if let Some((_, p)) = best {
                placed = refine(&c, d, &p, Rows::All, 200);
            }
        }
        let f = fit(&c, d, &placed, Some(&start), Rows::All).unwrap();
        show(&c, d, &f, &start, &folds, &before);
    } else {
        let g = diagnose(&c, d, &mut |_| {}).unwrap();
        for (r, round) in g.candidates.iter().enumerate() {
            println!("round {r}");
            for q in round.iter().take(8) {
                println!("   {:.1} {:?}", q.evidence, q.fit.placed.last().unwrap());
            }
        }
        println!("unknown {} p {:.3}", g.unknown, g.probability);
        show(&c, d, &g.best.fit, &g.declared, &folds, &before);
        for r in &g.rivals {
            println!("  rival {:?} {:.3}", r.ids, r.probability);
        }
    }
}
#[global_allocator]
static A: mimalloc::MiMalloc = mimalloc::MiMalloc;
