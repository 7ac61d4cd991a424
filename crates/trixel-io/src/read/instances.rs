//! Walks the graph of a scene: which node is placed where, each as often as paths lead to it.
//!
//! Files name their nodes by index or id, so a damaged one can hold cycles, chains of any depth, and few nodes that
//! stand for billions of placements. The walk uses no call stack and knows the number of placements before the first.

use super::Problem;
use super::transform::Affine;

/// A node's place under its parent.
#[derive(Clone, Copy, Debug)]
pub(super) struct Child {
    /// Index of the node.
    pub(super) node: usize,
    /// From the node's space to its parent's.
    pub(super) transform: Affine,
}

/// Calls `visit` with each node reachable from `roots` and the map from its space to the scene's, parents first and in
/// the order of the file; a node with several paths to it is visited once for each.
///
/// # Errors
/// A child that does not exist, a cycle, or more than `limit` placements, each naming a node by `name`; and whatever
/// `visit` returns.
pub(super) fn walk(
    children: &[Vec<Child>],
    roots: &[Child],
    limit: u64,
    name: impl Fn(usize) -> String,
    mut visit: impl FnMut(usize, &Affine) -> Result<(), Problem>,
) -> Result<(), Problem> {
    let placements = count_placements(children, roots, &name)?;
    if placements > limit {
        return Err(Problem::new(
            "scene",
            format!(
                "instances of instances place {placements} objects, more than the {limit} that a file of this size may; \
                 the file is damaged or made to exhaust memory"
            ),
        ));
    }
    let mut pending: Vec<Child> = roots.iter().rev().copied().collect();
    while let Some(Child { node, transform }) = pending.pop() {
        visit(node, &transform)?;
        for child in children.get(node).into_iter().flatten().rev() {
            pending.push(Child { node: child.node, transform: transform.after(&child.transform) });
        }
    }
    Ok(())
}

/// The number of paths from `roots` to any node, saturating.
fn count_placements(children: &[Vec<Child>], roots: &[Child], name: &impl Fn(usize) -> String) -> Result<u64, Problem> {
    #[derive(Clone, Copy)]
    enum State {
        New,
        Open,
        Done(u64),
    }
    /// A node being counted: its next child, and the placements below it so far.
    struct Frame {
        node: usize,
        next: usize,
        total: u64,
    }
    let mut states = vec![State::New; children.len()];
    let mut sum = 0u64;
    for root in roots {
        let mut stack: Vec<Frame> = Vec::new();
        let mut enter = Some(root.node);
        let mut done = 0;
        loop {
            if let Some(node) = enter.take() {
                match states.get(node) {
                    None => {
                        return Err(Problem::new(
                            "scene",
                            format!("{} does not exist; the file is damaged", name(node)),
                        ));
                    }
                    Some(State::Open) => {
                        return Err(Problem::new(
                            name(node),
                            "contains itself: the scene has a cycle; export the file again",
                        ));
                    }
                    Some(State::Done(total)) => done = *total,
                    Some(State::New) => {
                        states[node] = State::Open;
                        stack.push(Frame { node, next: 0, total: 1 });
                    }
                }
            }
            let Some(frame) = stack.last_mut() else { break };
            frame.total = frame.total.saturating_add(done);
            done = 0;
            if let Some(child) = children[frame.node].get(frame.next) {
                frame.next += 1;
                enter = Some(child.node);
            } else {
                done = frame.total;
                states[frame.node] = State::Done(done);
                stack.pop();
                if stack.is_empty() {
                    break;
                }
            }
        }
        sum = sum.saturating_add(done);
    }
    Ok(sum)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn child(node: usize) -> Child {
        Child { node, transform: Affine::translation([1.0, 0.0, 0.0]) }
    }

    fn visits(children: &[Vec<Child>], roots: &[usize], limit: u64) -> Result<Vec<(usize, f64)>, Problem> {
        let roots: Vec<Child> = roots.iter().map(|&node| child(node)).collect();
        let mut seen = Vec::new();
        walk(
            children,
            &roots,
            limit,
            |node| format!("node {node}"),
            |node, map| {
                seen.push((node, map.0[0][3]));
                Ok(())
            },
        )?;
        Ok(seen)
    }

    #[test]
    fn parents_first_and_shared_nodes_once_a_path() {
        let graph = [vec![child(1), child(2)], vec![child(2)], vec![]];
        assert_eq!(visits(&graph, &[0], 4).unwrap(), [(0, 1.0), (1, 2.0), (2, 3.0), (2, 2.0)]);
    }

    #[test]
    fn limit_counts_every_path() {
        let graph = [vec![child(1), child(2)], vec![child(2)], vec![]];
        assert!(visits(&graph, &[0, 2], 5).is_ok());
        let problem = visits(&graph, &[0, 2], 4).unwrap_err();
        assert!(problem.what.contains("place 5 objects"), "{problem}");
    }

    #[test]
    fn cycle_is_named() {
        let graph = [vec![child(1)], vec![child(2)], vec![child(1)]];
        let problem = visits(&graph, &[0], 100).unwrap_err();
        assert_eq!(problem.at, "node 1");
        assert!(problem.what.contains("cycle"));
    }

    #[test]
    fn missing_child_is_named() {
        assert!(visits(&[vec![child(7)]], &[0], 100).unwrap_err().what.contains("node 7 does not exist"));
        assert!(visits(&[], &[0], 100).is_err());
    }

    #[test]
    fn exponential_graph_is_refused_at_once() {
        let graph: Vec<Vec<Child>> =
            (0..200).map(|i| if i < 199 { vec![child(i + 1), child(i + 1)] } else { vec![] }).collect();
        assert!(visits(&graph, &[0], 1 << 22).is_err());
    }

    #[test]
    fn chain_of_a_hundred_thousand_nodes_needs_no_stack() {
        let graph: Vec<Vec<Child>> =
            (0..100_000).map(|i| if i < 99_999 { vec![child(i + 1)] } else { vec![] }).collect();
        assert_eq!(visits(&graph, &[0], 100_000).unwrap().last(), Some(&(99_999, 100_000.0)));
    }
}
