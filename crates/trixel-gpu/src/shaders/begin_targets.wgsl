// Rows of values before anything is blended into them. `begin_values` is prepended, for the targets asked for.

struct Length {
    rows: u32,
}

@group(0) @binding(0) var<uniform> length: Length;
@group(0) @binding(1) var<storage, read_write> values: array<atomic<u32>>;

@compute @workgroup_size(WORKGROUP)
fn begin_targets(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let i = invocation(group, groups, local);
    if i < length.rows {
        begin_values(i * TARGETS);
    }
}
