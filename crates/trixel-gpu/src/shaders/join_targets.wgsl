// The rows that workgroups wrote, blended into one a voxel in the order of the list. `blend_values` is prepended, for the
// targets asked for.

// A voxel's entry and its values, after four other words.
@group(0) @binding(3) var<storage, read> rows: array<u32>;
@group(0) @binding(4) var<storage, read_write> values: array<atomic<u32>>;

@compute @workgroup_size(WORKGROUP)
fn join_targets(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let i = invocation(group, groups, local);
    if i >= locate.items {
        return;
    }
    let at = 4u + (2u + TARGETS) * i;
    let voxel = voxel_of(vec2<u32>(rows[at], rows[at + 1u]));
    if voxel.x - locate.slab_x >= locate.slab_nx {
        return;
    }
    var painted: Painted;
    for (var t = 0u; t < TARGETS; t++) {
        painted[t] = rows[at + 2u + t];
    }
    blend_values(place_of(voxel).number * TARGETS, painted);
}
