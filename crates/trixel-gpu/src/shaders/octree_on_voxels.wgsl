// The last level of an octree without attributes: its octants are voxels, which are all full and have no nodes.

fn is_full(child: u32) -> bool {
    return true;
}

fn mixed_before(child: u32) -> u32 {
    return 0u;
}
