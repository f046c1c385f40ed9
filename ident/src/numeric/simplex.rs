//! Where a function of a few numbers is least.
//!
//! What it is: the simplex search of Nelder and Mead, which asks for no derivative.
//! What can go wrong: it ends in the valley that it starts in.
//! Units: none.
//! Reference: Nelder & Mead 1965, The Computer Journal 7:308.

/// Where `cost` is least: a simplex search from `x0` with first `steps`, after about so many evaluations.
pub fn nelder_mead(cost: &dyn Fn(&[f64]) -> f64, x0: &[f64], steps: &[f64], evaluations: usize) -> Vec<f64> {
    let n = x0.len();
    let mut simplex: Vec<(Vec<f64>, f64)> = vec![(x0.to_vec(), cost(x0))];
    for i in 0..n {
        let mut x = x0.to_vec();
        x[i] += steps[i];
        let c = cost(&x);
        simplex.push((x, c));
    }
    let mut used = n + 1;
    while used < evaluations {
        simplex.sort_by(|a, b| a.1.total_cmp(&b.1));
        if simplex[n].1 - simplex[0].1 < 1e-5 {
            break;
        }
        let centre: Vec<f64> = (0..n).map(|j| simplex[..n].iter().map(|s| s.0[j]).sum::<f64>() / n as f64).collect();
        let along = |k: f64| -> Vec<f64> { (0..n).map(|j| centre[j] + k * (simplex[n].0[j] - centre[j])).collect() };
        let reflected = along(-1.0);
        let c = cost(&reflected);
        used += 1;
        if c < simplex[0].1 {
            let expanded = along(-2.0);
            let e = cost(&expanded);
            used += 1;
            simplex[n] = if e < c { (expanded, e) } else { (reflected, c) };
        } else if c < simplex[n - 1].1 {
            simplex[n] = (reflected, c);
        } else {
            let inside = along(if c < simplex[n].1 { -0.5 } else { 0.5 });
            let i = cost(&inside);
            used += 1;
            if i < simplex[n].1.min(c) {
                simplex[n] = (inside, i);
            } else {
                let best = simplex[0].0.clone();
                for s in simplex.iter_mut().skip(1) {
                    for (v, b) in s.0.iter_mut().zip(&best) {
                        *v = b + 0.5 * (*v - b);
                    }
                    s.1 = cost(&s.0);
                    used += 1;
                }
            }
        }
    }
    simplex.into_iter().min_by(|a, b| a.1.total_cmp(&b.1)).map_or_else(|| x0.to_vec(), |s| s.0)
}
