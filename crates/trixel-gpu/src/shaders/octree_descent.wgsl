// The way down an octree, without a stack: the twin of `Octree::find`. `tree` is one of the askers' own.

@group(0) @binding(3) var<storage, read> nodes: array<vec2<u32>>;

// What a cube holds.
const EMPTY: u32 = 0u;
const FULL: u32 = 1u;
const MIXED: u32 = 2u;

struct Found {
    content: u32,
    // Of the largest cube around the voxel that holds nothing or is full, or of the one asked for.
    level: u32,
    // The node of a mixed cube; of a voxel, where its look is, if there are looks.
    index: u32,
}

// What is at a voxel of the root's cube, down to the cube of 2^last voxels around it.
fn descend(voxel: vec3<u32>, last: u32) -> Found {
    if tree.nodes == 0u {
        return Found(select(EMPTY, FULL, tree.everything != 0u), tree.height, 0u);
    }
    var node = 0u;
    for (var level = tree.height; level > last; level--) {
        let half = (voxel >> vec3<u32>(level - 1u)) & vec3<u32>(1u);
        let octant = 1u << ((half.x << 2u) | (half.y << 1u) | half.z);
        let some = nodes[node].x & 0xffu;
        let full = (nodes[node].x >> 8u) & 0xffu;
        if (some & octant) == 0u {
            return Found(EMPTY, level - 1u, 0u);
        }
        if (full & octant) != 0u {
            return Found(FULL, level - 1u, nodes[node].y + countOneBits(some & (octant - 1u)));
        }
        node = nodes[node].y + countOneBits(some & ~full & (octant - 1u));
    }
    return Found(MIXED, last, node);
}
