// The last level of an octree with attributes: voxels that have any are never pruned.

@group(0) @binding(3) var<storage, read> leaves: array<vec4<u32>>;

fn is_full(child: u32) -> bool {
    return is_bare(leaves[child]);
}

// Where the cube's voxels begin in the list.
fn mixed_before(child: u32) -> u32 {
    return child;
}
