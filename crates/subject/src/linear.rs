//! Small dense systems of linear equations.

/// Solves `A X = B` in place: each row holds a row of the square `A` and then
/// `right` columns of `B`, which become `X`. Directions that the equations
/// say nothing of become 0. Gauss-Jordan with row exchange.
pub(crate) fn solve(rows: &mut [Vec<f64>], right: usize) {
    let count = rows.len();
    for k in 0..count {
        let best = (k..count).max_by(|&a, &b| rows[a][k].abs().total_cmp(&rows[b][k].abs()));
        rows.swap(k, best.unwrap_or(k));
        let pivot = rows[k][k];
        if pivot.abs() < 1e-12 {
            rows[k].iter_mut().for_each(|value| *value = 0.0);
            continue;
        }
        rows[k].iter_mut().for_each(|value| *value /= pivot);
        let own = rows[k].clone();
        for (index, row) in rows.iter_mut().enumerate() {
            let factor = row[k];
            if index != k && factor != 0.0 {
                row.iter_mut().zip(&own).take(count + right).for_each(|(a, b)| *a -= factor * b);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    #[test]
    fn two_equations() {
        let mut rows = vec![vec![0.0, 2.0, 4.0], vec![3.0, 1.0, 5.0]];
        super::solve(&mut rows, 1);
        assert_eq!([rows[0][2], rows[1][2]], [1.0, 2.0]);
    }
}
