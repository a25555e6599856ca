//! Sparsity of a system, found once and shared: colouring of the Jacobian's columns, and the
//! elimination of `W = I/(h gamma) - J` in a fixed order as flat lists of operations.

use math::{Deps, Real};

/// Largest number of states for which the inverse of W is formed.
pub(crate) const SMALL: usize = 8;
/// Number of directions of one pass of dual numbers.
pub const DIRECTIONS: usize = 8;

/// Slot of a matrix entry in the array of stored values.
type Slot = u32;

/// One operation of a substitution: x[row] += value * x[column]. The values have the same order, and the sign
/// in which they are added.
#[derive(Clone, Copy, Debug)]
pub(crate) struct StructureEntry {
    pub row: u16,
    pub column: u16,
}

/// One pass of dual numbers: the direction of each state, and the slots of the results.
#[derive(Clone, Debug, Default)]
pub(crate) struct Pass {
    /// (state, direction)
    pub seeds: Vec<(u32, u32)>,
    /// (row, direction, slot)
    pub results: Vec<(u32, u32, Slot)>,
    /// Direction of time, if this pass includes it.
    pub time: Option<u32>,
}

/// One pivot of the elimination.
#[derive(Clone, Debug)]
pub(crate) struct Pivot {
    pub row: u32,
    pub diagonal: Slot,
    /// Entries below the pivot: each is divided by the pivot, then `updates` follow.
    pub below: Vec<Below>,
}

#[derive(Clone, Debug)]
pub(crate) struct Below {
    pub slot: Slot,
    /// (target, entry right of the pivot): target -= below * right
    pub updates: Vec<(Slot, Slot)>,
}

/// The sparsity of a system's Jacobian, and the colouring and elimination order that are computed from the sparsity.
#[derive(Clone, Debug)]
pub struct Structure {
    /// Number of states.
    pub n: usize,
    /// Number of stored values: the pattern with its fill-in.
    pub(crate) n_slots: usize,
    pub(crate) passes: Vec<Pass>,
    pub(crate) pivots: Vec<Pivot>,
    /// Strictly lower entries in elimination order, column by column: slots 0 .. lower.len().
    pub(crate) lower: Vec<StructureEntry>,
    /// Strictly upper entries in reverse elimination order, column by column: the slots that follow.
    pub(crate) upper: Vec<StructureEntry>,
    /// Entries of the quadratures' rows, column by column: the slots that follow. They take no part in the elimination.
    pub(crate) quadratures: Vec<StructureEntry>,
    /// Number of states that are not quadratures. Their diagonal is in the last slots.
    pub(crate) n_coupled: usize,
    pub(crate) depends_on_time: bool,
}

impl Structure {
    /// Largest number of states of a system, because tables of its pattern grow with the square.
    pub const MOST_STATES: usize = 512;

    /// Finds the structure from `f`, evaluated with dependency sets, and from the scale of each state.
    /// Quadratures (infinite scale) come after all other states and outside the elimination. A further
    /// quadrature therefore changes no bit of the rest. `depends_on_time` states that `f` contains `t`
    /// itself.
    ///
    /// Panics if a state depends on a quadrature or follows one.
    pub fn of(mut f: impl FnMut(&[Deps], &mut [Deps]), scale: &[f64], depends_on_time: bool) -> Self {
        let n = scale.len();
        let quadrature = |i: usize| scale[i].is_infinite();
        let n_coupled = (0..n).take_while(|&i| !quadrature(i)).count();
        assert!((n_coupled..n).all(quadrature), "quadratures come after all other states");
        let mut pattern = vec![Vec::new(); n];
        for first in (0..n).step_by(Deps::CAPACITY) {
            let y: Vec<Deps> = (0..n).map(|i| i.checked_sub(first).map_or(Deps::c(0.0), Deps::of)).collect();
            let mut rows = vec![Deps::c(0.0); n];
            f(&y, &mut rows);
            for (pattern, row) in pattern.iter_mut().zip(rows) {
                pattern.extend((0..Deps::CAPACITY.min(n - first)).map(|j| row.contains(j)));
            }
        }
        for row in &pattern {
            for (j, used) in row.iter().enumerate() {
                assert!(
                    !(*used && quadrature(j)),
                    "state {j} is a quadrature, yet the right-hand side uses it"
                );
            }
        }
        let coupled: Vec<Vec<bool>> =
            pattern[..n_coupled].iter().map(|row| row[..n_coupled].to_vec()).collect();
        let order = elimination_order(&coupled);
        let filled = fill_in(&coupled, &order);
        let (lower, upper) = substitutions(&filled, &order);
        let entry = |i: usize, j: usize| StructureEntry { row: i as u16, column: j as u16 };
        let pattern = &pattern;
        let of_column = |j: usize| (n_coupled..n).filter(move |&i| pattern[i][j]).map(move |i| entry(i, j));
        let quadratures: Vec<StructureEntry> = (0..n_coupled).flat_map(of_column).collect();
        let mut slots = vec![vec![Slot::MAX; n]; n];
        let diagonal = (0..n_coupled).map(|k| entry(k, k));
        let all = lower.iter().chain(&upper).chain(&quadratures).copied().chain(diagonal);
        for (slot, entry) in all.enumerate() {
            slots[entry.row as usize][entry.column as usize] = slot as Slot;
        }
        let n_slots = lower.len() + upper.len() + quadratures.len() + n_coupled;
        let passes = colour(pattern, &slots, &quadrature, depends_on_time);
        let pivots = factorisation(&filled, &slots, &order);
        Structure { n, n_slots, passes, pivots, lower, upper, quadratures, n_coupled, depends_on_time }
    }

    /// Returns whether the inverse of W alone solves every stage.
    pub(crate) fn is_small(&self) -> bool {
        self.n <= SMALL && self.n == self.n_coupled && !self.depends_on_time
    }
}

/// Markowitz order on the diagonal: the pivot with the least possible fill-in first.
fn elimination_order(pattern: &[Vec<bool>]) -> Vec<usize> {
    let n = pattern.len();
    let mut work: Vec<Vec<bool>> = pattern.to_vec();
    let mut left: Vec<usize> = (0..n).collect();
    let mut order = Vec::with_capacity(n);
    while !left.is_empty() {
        let count = |k: usize| {
            let row = left.iter().filter(|&&j| j != k && work[k][j]).count();
            let column = left.iter().filter(|&&i| i != k && work[i][k]).count();
            row * column
        };
        let at = (0..left.len()).min_by_key(|&p| count(left[p])).expect("not empty");
        let k = left.remove(at);
        for &i in left.iter().filter(|&&i| work[i][k]).collect::<Vec<_>>() {
            for &j in left.iter() {
                let fill = work[k][j];
                work[i][j] |= fill;
            }
        }
        order.push(k);
    }
    order
}

/// Returns the pattern with its diagonal and the entries that elimination adds.
fn fill_in(pattern: &[Vec<bool>], order: &[usize]) -> Vec<Vec<bool>> {
    let mut filled = pattern.to_vec();
    for (i, row) in filled.iter_mut().enumerate() {
        row[i] = true;
    }
    for (p, &k) in order.iter().enumerate() {
        for &i in order[p + 1..].iter() {
            if filled[i][k] {
                for &j in order[p + 1..].iter() {
                    let fill = filled[k][j];
                    filled[i][j] |= fill;
                }
            }
        }
    }
    filled
}

/// Groups columns that share no row into one direction of a dual number, `DIRECTIONS` to a pass.
fn colour(
    pattern: &[Vec<bool>],
    slots: &[Vec<Slot>],
    quadrature: &dyn Fn(usize) -> bool,
    depends_on_time: bool,
) -> Vec<Pass> {
    let n = pattern.len();
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for j in (0..n).filter(|&j| !quadrature(j) && pattern.iter().any(|row| row[j])) {
        let clash = |group: &Vec<usize>| group.iter().any(|&g| pattern.iter().any(|row| row[g] && row[j]));
        match groups.iter_mut().find(|group| !clash(group)) {
            Some(group) => group.push(j),
            None => groups.push(vec![j]),
        }
    }
    let n_directions = groups.len() + usize::from(depends_on_time);
    let mut passes = vec![Pass::default(); n_directions.div_ceil(DIRECTIONS)];
    for (g, group) in groups.iter().enumerate() {
        let (pass, direction) = (&mut passes[g / DIRECTIONS], (g % DIRECTIONS) as u32);
        for &j in group {
            pass.seeds.push((j as u32, direction));
            for i in (0..n).filter(|&i| pattern[i][j]) {
                pass.results.push((i as u32, direction, slots[i][j]));
            }
        }
    }
    if depends_on_time {
        passes[groups.len() / DIRECTIONS].time = Some((groups.len() % DIRECTIONS) as u32);
    }
    passes
}

/// Returns the entries of both substitutions, column by column. The entries of a column are independent.
fn substitutions(filled: &[Vec<bool>], order: &[usize]) -> (Vec<StructureEntry>, Vec<StructureEntry>) {
    let entry = |i: usize, j: usize| StructureEntry { row: i as u16, column: j as u16 };
    let (mut lower, mut upper) = (Vec::new(), Vec::new());
    for (p, &k) in order.iter().enumerate() {
        lower.extend(order[p + 1..].iter().filter(|&&i| filled[i][k]).map(|&i| entry(i, k)));
    }
    for (p, &k) in order.iter().enumerate().rev() {
        upper.extend(order[..p].iter().filter(|&&i| filled[i][k]).map(|&i| entry(i, k)));
    }
    (lower, upper)
}

/// Returns the operations of the factorisation, pivot by pivot.
fn factorisation(filled: &[Vec<bool>], slots: &[Vec<Slot>], order: &[usize]) -> Vec<Pivot> {
    let mut pivots = Vec::new();
    for (p, &k) in order.iter().enumerate() {
        let rest = &order[p + 1..];
        let mut below = Vec::new();
        for &i in rest.iter().filter(|&&i| filled[i][k]) {
            let updates =
                rest.iter().filter(|&&j| filled[k][j]).map(|&j| (slots[i][j], slots[k][j])).collect();
            below.push(Below { slot: slots[i][k], updates });
        }
        pivots.push(Pivot { row: k as u32, diagonal: slots[k][k], below });
    }
    pivots
}
