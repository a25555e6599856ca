//! The tableau is a Rosenbrock method of its stated order.
//!
//! From the transformed coefficients the classical ones are won back: Gamma^-1 = I/gamma - c,
//! alpha = a Gamma, b = m Gamma. A method has order p where, for every rooted tree of up to p
//! vertices, sum_i b_i Phi_i(tree) = 1/tree!, with beta = alpha + Gamma below a vertex with one son
//! and alpha below one with several (Hairer & Wanner, section IV.7). Trees are enumerated here, so
//! no condition can be forgotten.

#![allow(clippy::needless_range_loop)] // indices as in the book

use ode::{RODAS3, RODAS5P, Rosenbrock};

type Matrix<const S: usize> = [[f64; S]; S];
type Row<const S: usize> = [f64; S];

struct Classical<const S: usize> {
    alpha: Matrix<S>,
    beta: Matrix<S>,
    gamma: Matrix<S>,
    /// Weights of the step and of the embedded solution.
    b: Row<S>,
    embedded: Row<S>,
}

fn multiply<const S: usize>(a: &Matrix<S>, b: &Matrix<S>) -> Matrix<S> {
    let cell = |i: usize, j: usize| (0..S).map(|k| a[i][k] * b[k][j]).sum();
    std::array::from_fn(|i| std::array::from_fn(|j| cell(i, j)))
}

fn row_times<const S: usize>(m: &Row<S>, a: &Matrix<S>) -> Row<S> {
    std::array::from_fn(|j| (0..S).map(|i| m[i] * a[i][j]).sum())
}

/// Inverse of a lower triangular matrix.
fn inverse<const S: usize>(l: &Matrix<S>) -> Matrix<S> {
    let mut x = [[0.0; S]; S];
    for j in 0..S {
        for i in j..S {
            let known: f64 = (j..i).map(|k| l[i][k] * x[k][j]).sum();
            x[i][j] = (f64::from(i == j) - known) / l[i][i];
        }
    }
    x
}

/// m: stiff accuracy puts the last stage's row and one in front of the last U.
fn step_weights<const S: usize>(method: &Rosenbrock<S>) -> Row<S> {
    let mut m = method.a[S - 1];
    m[S - 1] = 1.0;
    m
}

impl<const S: usize> Classical<S> {
    fn of(method: &Rosenbrock<S>) -> Self {
        let cell = |i: usize, j: usize| if i == j { 1.0 / method.gamma } else { -method.c[i][j] };
        let gamma = inverse(&std::array::from_fn(|i| std::array::from_fn(|j| cell(i, j))));
        let alpha = multiply(&method.a, &gamma);
        let beta = std::array::from_fn(|i| std::array::from_fn(|j| alpha[i][j] + gamma[i][j]));
        Classical {
            alpha,
            beta,
            b: row_times(&step_weights(method), &gamma),
            embedded: row_times(&method.a[S - 1], &gamma),
            gamma,
        }
    }

    /// b(theta) of dense output: y(theta) = y0 + sum_j b_j(theta) k_j.
    fn dense(&self, method: &Rosenbrock<S>, theta: f64) -> Row<S> {
        let m = step_weights(method);
        let [k1, k2, k3] = &method.dense;
        let s = 1.0 - theta;
        let weights = std::array::from_fn(|j| theta * (m[j] + s * (k1[j] + theta * (k2[j] + theta * k3[j]))));
        row_times(&weights, &self.gamma)
    }
}

/// A rooted tree as the list of its sons, in a canonical order.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Tree(Vec<Tree>);

impl Tree {
    fn order(&self) -> usize {
        1 + self.0.iter().map(Tree::order).sum::<usize>()
    }

    /// Its density: the order times the densities of the sons.
    fn density(&self) -> f64 {
        self.order() as f64 * self.0.iter().map(Tree::density).product::<f64>()
    }

    fn weights<const S: usize>(&self, method: &Classical<S>) -> Row<S> {
        let below = match self.0.len() {
            1 => &method.beta,
            _ => &method.alpha,
        };
        let mut product = [1.0; S];
        for son in &self.0 {
            let w = son.weights(method);
            for i in 0..S {
                product[i] *= (0..S).map(|j| below[i][j] * w[j]).sum::<f64>();
            }
        }
        product
    }

    /// Residual of its condition for weights `b` that advance by `theta` of a step.
    fn residual<const S: usize>(&self, method: &Classical<S>, b: &Row<S>, theta: f64) -> f64 {
        let phi = self.weights(method);
        let sum: f64 = (0..S).map(|i| b[i] * phi[i]).sum();
        sum - theta.powi(self.order() as i32) / self.density()
    }
}

/// All rooted trees with `order` vertices: a smaller tree with one more leaf somewhere.
fn trees(order: usize) -> Vec<Tree> {
    fn grown(tree: &Tree) -> Vec<Tree> {
        let mut out = vec![sorted([tree.0.clone(), vec![Tree(vec![])]].concat())];
        for (i, son) in tree.0.iter().enumerate() {
            for larger in grown(son) {
                let mut sons = tree.0.clone();
                sons[i] = larger;
                out.push(sorted(sons));
            }
        }
        out
    }
    fn sorted(mut sons: Vec<Tree>) -> Tree {
        sons.sort();
        Tree(sons)
    }
    if order == 1 {
        return vec![Tree(vec![])];
    }
    let mut all: Vec<Tree> = trees(order - 1).iter().flat_map(grown).collect();
    all.sort();
    all.dedup();
    all
}

fn worst(order: usize, residual: impl Fn(&Tree) -> f64) -> f64 {
    let all = (1..=order).flat_map(trees);
    all.map(|tree| residual(&tree).abs()).fold(0.0, f64::max)
}

#[test]
fn as_many_trees_as_there_are() {
    let counts: Vec<usize> = (1..=6).map(|order| trees(order).len()).collect();
    assert_eq!(counts, [1, 1, 2, 4, 9, 20]); // the Butcher trees
}

/// Orders of the step, its embedded solution and its dense output: as stated, and of the first two no more.
fn has_its_orders<const S: usize>(of: &Rosenbrock<S>) {
    let method = Classical::of(of);
    for (b, order) in [(&method.b, of.order), (&method.embedded, of.error_order)] {
        let residual = |tree: &Tree| tree.residual(&method, b, 1.0);
        let (held, next) = (worst(order as usize, residual), worst(order as usize + 1, residual));
        assert!(held < 1e-12, "{}, order {order}: {held:e}", of.name);
        assert!(next > 1e-5, "{}: the conditions of order {order} would see nothing", of.name);
    }
    assert!(of.error_order < of.order);
    for theta in [0.1, 0.25, 0.5, 0.75, 0.9, 1.0] {
        let b = method.dense(of, theta);
        let error = worst(of.dense_order as usize, |tree| tree.residual(&method, &b, theta));
        assert!(error < 1e-12, "{}, theta = {theta}: {error:e}", of.name);
    }
    for i in 0..S {
        let alpha: f64 = method.alpha[i].iter().sum();
        let gamma: f64 = method.gamma[i].iter().sum();
        assert!((alpha - of.alpha[i]).abs() < 1e-12, "{}: alpha {i}", of.name);
        assert!((gamma - of.gamma_t[i]).abs() < 1e-12, "{}: gamma {i}", of.name);
    }
}

#[test]
fn rodas5p_has_its_orders() {
    assert_eq!((RODAS5P.order, RODAS5P.error_order, RODAS5P.dense_order), (5, 4, 4));
    has_its_orders(&RODAS5P);
}

#[test]
fn rodas3_has_its_orders() {
    assert_eq!((RODAS3.order, RODAS3.error_order, RODAS3.dense_order), (3, 2, 2));
    has_its_orders(&RODAS3);
}

/// Stability function R(z) = 1 + z b (I - z beta)^-1 1, on z = i y as (re, im).
fn on_the_imaginary_axis<const S: usize>(method: &Classical<S>, b: &Row<S>, y: f64) -> (f64, f64) {
    let mut x = [(0.0, 0.0); S];
    for i in 0..S {
        let (mut re, mut im) = (1.0, 0.0);
        for j in 0..i {
            re -= y * method.beta[i][j] * x[j].1;
            im += y * method.beta[i][j] * x[j].0;
        }
        let d = -y * method.beta[i][i];
        let size = 1.0 + d * d;
        x[i] = ((re + im * d) / size, (im - re * d) / size);
    }
    let sum = |part: &dyn Fn((f64, f64)) -> f64| -> f64 { (0..S).map(|i| b[i] * part(x[i])).sum() };
    (1.0 - y * sum(&|x| x.1), y * sum(&|x| x.0))
}

#[test]
fn both_are_stiffly_accurate_and_l_stable() {
    is_stiffly_accurate_and_l_stable(&RODAS5P);
    is_stiffly_accurate_and_l_stable(&RODAS3);
}

fn is_stiffly_accurate_and_l_stable<const S: usize>(of: &Rosenbrock<S>) {
    let method = Classical::of(of);
    assert!((of.alpha[S - 1] - 1.0).abs() < 1e-15);
    for j in 0..S {
        let last = method.beta[S - 1][j];
        assert!((method.b[j] - last).abs() < 1e-12, "b is the last stage");
    }
    // Poles lie at 1/gamma > 0 alone, so |R| <= 1 on the imaginary axis means in the left half plane.
    assert!(of.gamma > 0.0);
    for k in 0..=1200 {
        let y = 10.0_f64.powf(-3.0 + k as f64 / 100.0);
        let (re, im) = on_the_imaginary_axis(&method, &method.b, y);
        assert!(re.hypot(im) <= 1.0 + 1e-12, "y = {y}: {}", re.hypot(im));
        let apart = (re - y.cos()).hypot(im - y.sin());
        assert!(y > 0.1 || apart < 1e-12 + y.powi(of.order as i32 + 1), "R(z) is exp(z) near 0");
    }
    let far = on_the_imaginary_axis(&method, &method.b, 1e9);
    assert!(far.0.hypot(far.1) < 1e-7, "R(inf) = {far:?}");
    let embedded = on_the_imaginary_axis(&method, &method.embedded, 1e9);
    assert!(embedded.0.hypot(embedded.1) < 1e-6, "{embedded:?}");
}
