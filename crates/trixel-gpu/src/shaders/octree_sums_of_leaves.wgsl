// Averages of the last level's nodes are of voxels.

@group(0) @binding(3) var<storage, read> leaves: array<vec4<u32>>;

fn sum_below(child: u32) -> Sum {
    return sum_of(leaves[child]);
}
