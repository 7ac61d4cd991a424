// Pairs of a triangle and something that it has several of, numbered through by prefix sums.

// For each triangle the pairs of those before it, and the number of all.
@group(1) @binding(0) var<storage, read> before: array<u32>;
@group(1) @binding(1) var<storage, read> total: u32;

// The last triangle whose pairs begin at or before this one; those without any are passed over.
fn triangle_of_pair(pair: u32) -> u32 {
    var low = 0u;
    var high = params.triangles;
    while high - low > 1u {
        let middle = low + (high - low) / 2u;
        if before[middle] <= pair {
            low = middle;
        } else {
            high = middle;
        }
    }
    return low;
}
