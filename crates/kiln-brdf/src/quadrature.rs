//! Rules on (0, 1): double-exponential ones for any behaviour at the ends, Gauss' for smooth pieces.

use kiln_sphere::quadrature::gauss_legendre;

/// A node of a rule on (0, 1).
#[derive(Clone, Copy, Debug)]
pub(crate) struct Node {
    /// Distance from 0.
    pub(crate) from_start: f64,
    /// Distance from 1, exact even where `from_start` rounds to 1.
    pub(crate) from_end: f64,
    pub(crate) weight: f64,
}

/// Tanh–sinh rule of 2 · `half` + 1 points (Takahasi and Mori 1974).
///
/// Converges like exp(−c n / ln n) for functions analytic inside, whatever happens at the ends. The
/// outermost nodes stand exp(−π sinh `reach`) away from them: 1e-20 for 3.4.
pub(crate) fn tanh_sinh(half: usize, reach: f64) -> Vec<Node> {
    let step = reach / half as f64;
    let node = |k: isize| {
        let t = k as f64 * step;
        let u = std::f64::consts::FRAC_PI_2 * libm::sinh(t);
        // 1/(1 + e^±2u): both distances without cancellation.
        let from_end = 1.0 / (1.0 + libm::exp(2.0 * u));
        let from_start = 1.0 / (1.0 + libm::exp(-2.0 * u));
        let weight = step * std::f64::consts::PI * libm::cosh(t) * from_start * from_end;
        Node { from_start, from_end, weight }
    };
    (-(half as isize)..=half as isize).map(node).collect()
}

/// Gauss–Legendre rule.
pub(crate) fn gauss(count: usize) -> Vec<Node> {
    let node = |(x, weight): (f64, f64)| Node {
        from_start: 0.5 * (1.0 + x),
        from_end: 0.5 * (1.0 - x),
        weight: 0.5 * weight,
    };
    gauss_legendre(count).into_iter().map(node).collect()
}

/// Gauss–Legendre rule in t, 1 − x = (1 − t)²: for functions of √(1 − x).
pub(crate) fn gauss_towards_end(count: usize) -> Vec<Node> {
    let squeeze = |node: Node| Node {
        from_start: node.from_start * (1.0 + node.from_end),
        from_end: node.from_end * node.from_end,
        weight: node.weight * 2.0 * node.from_end,
    };
    gauss(count).into_iter().map(squeeze).collect()
}

#[cfg(test)]
mod tests {
    use super::{Node, gauss, gauss_towards_end, tanh_sinh};

    fn integrate(rule: &[Node], f: impl Fn(&Node) -> f64) -> f64 {
        rule.iter().map(|node| node.weight * f(node)).sum()
    }

    #[test]
    fn rules_integrate_endpoint_singularities() {
        let rule = tanh_sinh(40, 3.4);
        let root = integrate(&rule, |n| n.from_start.sqrt());
        let inverse_root = integrate(&rule, |n| 1.0 / n.from_end.sqrt());
        assert!((root - 2.0 / 3.0).abs() <= 1e-12, "{root}");
        assert!((inverse_root - 2.0).abs() <= 1e-8, "{inverse_root}");
        let squeezed = integrate(&gauss_towards_end(8), |n| 1.0 / n.from_end.sqrt());
        assert!((squeezed - 2.0).abs() <= 1e-14, "{squeezed}");
    }

    #[test]
    fn rules_too_small_for_a_function_are_seen_to_be() {
        let coarse = integrate(&tanh_sinh(3, 3.4), |n| n.from_start.sqrt());
        assert!((coarse - 2.0 / 3.0).abs() > 1e-6, "seven points are not enough");
        let plain = integrate(&gauss(8), |n| 1.0 / n.from_end.sqrt());
        assert!((plain - 2.0).abs() > 1e-2, "the singularity needs the other variable");
    }
}
