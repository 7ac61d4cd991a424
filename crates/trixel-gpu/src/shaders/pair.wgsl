// Which triangle a pair of a triangle and one of its columns or slices belongs to.

// The prefix sums of the triangles' columns or slices.
@group(1) @binding(0) var<storage, read> before: array<u32>;

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
