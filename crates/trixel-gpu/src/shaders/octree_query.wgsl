// Questions to an octree of the GPU: what is at voxels, down to a level of detail.

struct Tree {
    // The root's cube is 2^height voxels wide.
    height: u32,
    // Where there are no nodes: whether every voxel is set.
    everything: u32,
    nodes: u32,
    questions: u32,
    // At most the height.
    level: u32,
}

@group(0) @binding(0) var<uniform> tree: Tree;
// Voxels, as entries; what is asked beyond the root's cube, nobody reads the answer to.
@group(0) @binding(1) var<storage, read> questions: array<vec2<u32>>;
// Five words each: what the cube holds, then its look.
@group(0) @binding(2) var<storage, read_write> answers: array<u32>;
// Of trees without attributes one of each, which nobody reads.
@group(0) @binding(4) var<storage, read> node_looks: array<vec4<u32>>;
@group(0) @binding(5) var<storage, read> voxel_looks: array<vec4<u32>>;

@compute @workgroup_size(WORKGROUP)
fn answer(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let i = invocation(group, groups, local);
    if i >= tree.questions {
        return;
    }
    let found = descend(voxel_of(questions[i]), tree.level);
    var look = vec4<u32>(0u);
    if found.content == MIXED {
        look = node_looks[min(found.index, arrayLength(&node_looks) - 1u)];
    } else if found.content == FULL && found.level == 0u {
        look = voxel_looks[min(found.index, arrayLength(&voxel_looks) - 1u)];
    }
    answers[5u * i] = found.content;
    answers[5u * i + 1u] = look.x;
    answers[5u * i + 2u] = look.y;
    answers[5u * i + 3u] = look.z;
    answers[5u * i + 4u] = look.w;
}
