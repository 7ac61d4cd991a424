// Mode solid: carries the parity toggles upwards, so that a voxel is set when an odd number of toggles lie at or below it.
// Where voxels are listed, they are now: LISTING is prepended.

@group(0) @binding(3) var<storage, read_write> voxels: array<u32>;

@compute @workgroup_size(WORKGROUP)
fn fill(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let column = invocation(group, groups, local);
    if column >= u32(params.slab_nx) * u32(params.dims.y) {
        return;
    }
    let start = column * params.column_words;
    let end = start + (u32(params.dims.z) + 31u) / 32u;
    var carry = 0u;
    let at = vec2<u32>(u32(params.slab_x) + column / u32(params.dims.y), column % u32(params.dims.y));
    for (var i = start; i < end; i++) {
        var word = voxels[i];
        if (word | carry) == 0u {
            continue;
        }
        word ^= word << 1u;
        word ^= word << 2u;
        word ^= word << 4u;
        word ^= word << 8u;
        word ^= word << 16u;
        word ^= carry;
        carry = select(0u, 0xffffffffu, (word >> 31u) == 1u);
        if i + 1u == end {
            // No bits above the grid.
            word &= 0xffffffffu >> (31u - ((u32(params.dims.z) - 1u) & 31u));
        }
        voxels[i] = word;
        if LISTING && word != 0u {
            append(at, 32u * (i - start), word);
        }
    }
}
