// What is at a voxel of an octree.

@group(0) @binding(3) var<storage, read> nodes: array<vec2<u32>>;

fn place_of(voxel: vec3<u32>) -> Place {
    if tree.nodes == 0u {
        return Place(tree.everything != 0u, tree.height);
    }
    var node = 0u;
    for (var level = tree.height; level > 0u; level--) {
        let half = (voxel >> vec3<u32>(level - 1u)) & vec3<u32>(1u);
        let octant = 1u << ((half.x << 2u) | (half.y << 1u) | half.z);
        let some = nodes[node].x & 0xffu;
        let full = (nodes[node].x >> 8u) & 0xffu;
        if (some & octant) == 0u {
            return Place(false, level - 1u);
        }
        if (full & octant) != 0u {
            return Place(true, level - 1u);
        }
        node = nodes[node].y + countOneBits(some & ~full & (octant - 1u));
    }
    return Place(false, 0u);
}
