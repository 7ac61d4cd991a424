//! What got faster or slower between two results.

use crate::results::{Cell, Results};

/// A cell that both results have.
#[derive(Clone, Debug)]
pub struct Change {
    /// The cell now.
    pub now: Cell,
    /// Its median then, in milliseconds.
    pub before_ms: f64,
}

impl Change {
    /// The time now over the time then: below 1 is faster.
    #[must_use]
    pub fn ratio(&self) -> f64 {
        self.now.median_ms / self.before_ms
    }

    /// Whether the ranges of all runs do not even overlap.
    #[must_use]
    pub fn is_clear(&self, before: &Cell) -> bool {
        self.now.max_ms < before.min_ms || self.now.min_ms > before.max_ms
    }
}

/// Every cell of both, in the order of `now`.
#[must_use]
pub fn changes(now: &Results, before: &Results) -> Vec<Change> {
    let old = |cell: &Cell| before.cell(&cell.mesh, cell.resolution, (&cell.backend, &cell.strategy));
    let both = now.cells.iter().filter_map(|cell| Some((cell, old(cell)?)));
    both.map(|(cell, old)| Change { now: cell.clone(), before_ms: old.median_ms }).collect()
}

/// The changes in words, one line each, and a warning where other conditions hold.
#[must_use]
pub fn text(now: &Results, before: &Results) -> String {
    let mut out = String::new();
    let adapter =
        |results: &Results| results.adapter.as_ref().map(|adapter| (adapter.name.clone(), adapter.tier.clone()));
    if adapter(now) != adapter(before) || now.machine.cpu != before.machine.cpu || now.mode != before.mode {
        out.push_str("These were measured on another machine, adapter or mode:\n");
    }
    for change in changes(now, before) {
        let Cell { mesh, resolution, backend, strategy, median_ms, .. } = &change.now;
        let ratio = change.ratio();
        let old = before.cell(mesh, *resolution, (backend, strategy));
        let verdict = match old {
            Some(old) if change.is_clear(old) => {
                if ratio < 1.0 {
                    "faster"
                } else {
                    "SLOWER"
                }
            }
            _ => "within the spread",
        };
        out.push_str(&format!(
            "{mesh} at {resolution}, {backend} {strategy}: {} ms, was {} ms ({ratio:.2}), {verdict}\n",
            crate::text::ms(*median_ms),
            crate::text::ms(change.before_ms),
        ));
    }
    if out.is_empty() {
        out.push_str("The results have no cell in common.\n");
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use trixel::Mode;

    fn results(times: [f64; 3]) -> Results {
        let mut results = Results::new(None, Mode::Thin);
        let [min_ms, median_ms, max_ms] = times;
        results.cells.push(Cell {
            mesh: "a <b>".to_owned(),
            triangles: 1,
            resolution: 64,
            backend: "cpu".to_owned(),
            strategy: "column-runs".to_owned(),
            cutoff: None,
            runs: 3,
            median_ms,
            min_ms,
            max_ms,
            passes_ms: vec![],
            counters: None,
            voxels: 5,
            wrong_voxels: 0,
        });
        results
    }

    #[test]
    fn only_what_leaves_the_spread_is_called_faster_or_slower() {
        let before = results([2.0, 3.0, 4.0]);
        let verdict = |times: [f64; 3]| text(&results(times), &before);
        assert!(verdict([1.0, 1.5, 1.9]).contains("(0.50), faster"));
        assert!(verdict([4.5, 6.0, 7.0]).contains("(2.00), SLOWER"));
        assert!(verdict([3.0, 5.0, 7.0]).contains("within the spread"));
        assert!(text(&results([1.0; 3]), &Results::new(None, Mode::Thin)).contains("no cell in common"));
        let solid = Results::new(None, Mode::Solid);
        assert!(text(&results([1.0; 3]), &solid).contains("another machine"));
    }

    #[test]
    fn names_do_not_become_markup() {
        let page = crate::html::page(&results([1.0, 2.0, 3.0]));
        assert!(page.contains("a &lt;b&gt;") && !page.contains("a <b>"));
    }
}
