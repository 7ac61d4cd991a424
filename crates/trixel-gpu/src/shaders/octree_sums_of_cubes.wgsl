// Averages of all other nodes are of the level below.

@group(0) @binding(3) var<storage, read> sums_below: array<Sum>;

fn sum_below(child: u32) -> Sum {
    return sums_below[child];
}
