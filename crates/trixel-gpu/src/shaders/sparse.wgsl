// Sparse structures from a list along the Morton curve: there, the voxels of a cube follow each other. Shared by the octree and
// the brick map: which entries are the first of their cube.

struct Sparse {
    entries: u32,
    // Cubes are 2^shift entries wide.
    shift: u32,
}

@group(0) @binding(0) var<uniform> sparse: Sparse;
@group(0) @binding(1) var<storage, read> list: array<vec2<u32>>;
// 1 for the first entry of each cube; then, summed up, how many cubes begin before each entry.
@group(0) @binding(2) var<storage, read_write> begun: array<u32>;

fn cube_of(i: u32) -> vec3<u32> {
    return voxel_of(list[i]) >> vec3<u32>(sparse.shift);
}

fn is_first(i: u32) -> bool {
    return i == 0u || any(cube_of(i) != cube_of(max(i, 1u) - 1u));
}

// One past the last entry of the cube of eight whose first is entry i.
fn end_of_eight(i: u32) -> u32 {
    let cube = cube_of(i);
    let most = min(i + 8u, sparse.entries);
    var end = i + 1u;
    while end < most && all(cube_of(end) == cube) {
        end++;
    }
    return end;
}

@compute @workgroup_size(WORKGROUP)
fn mark_cubes(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let i = invocation(group, groups, local);
    if i < sparse.entries {
        begun[i] = select(0u, 1u, is_first(i));
    }
}
