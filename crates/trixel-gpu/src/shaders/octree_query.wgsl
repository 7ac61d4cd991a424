// Questions to an octree of the GPU, without a stack: the twin of `Octree::get` in `octree.rs`.

struct Tree {
    // The root's cube is 2^height voxels wide.
    height: u32,
    // Where there are no nodes: whether every voxel is set.
    everything: u32,
    nodes: u32,
    questions: u32,
}

@group(0) @binding(0) var<uniform> tree: Tree;
@group(0) @binding(1) var<storage, read> nodes: array<vec2<u32>>;
@group(0) @binding(2) var<storage, read> questions: array<vec2<u32>>;
@group(0) @binding(3) var<storage, read_write> answers: array<u32>;

fn is_set(voxel: vec3<u32>) -> bool {
    if any(voxel >= vec3<u32>(1u << tree.height)) {
        return false;
    }
    var node = 0u;
    var found = tree.everything != 0u;
    var there = tree.nodes > 0u;
    for (var level = tree.height; there && level > 0u; level--) {
        let half = (voxel >> vec3<u32>(level - 1u)) & vec3<u32>(1u);
        let octant = 1u << ((half.x << 2u) | (half.y << 1u) | half.z);
        let some = nodes[node].x & 0xffu;
        let full = nodes[node].x >> 8u;
        found = (full & octant) != 0u;
        there = (some & ~full & octant) != 0u;
        node = nodes[node].y + countOneBits(some & ~full & (octant - 1u));
    }
    return found;
}

@compute @workgroup_size(WORKGROUP)
fn answer(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let i = invocation(group, groups, local);
    if i < tree.questions {
        answers[i] = select(0u, 1u, is_set(voxel_of(questions[i])));
    }
}
