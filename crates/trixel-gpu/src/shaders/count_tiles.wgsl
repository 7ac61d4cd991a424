// For `tiled`: how many tiles each triangle's box meets.

@group(1) @binding(0) var<storage, read_write> tiles: array<u32>;

@compute @workgroup_size(WORKGROUP)
fn count_tiles(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let i = invocation(group, groups, local);
    if i < params.triangles {
        let look = look_at(i);
        var number = 0u;
        if look.columns != 0u {
            let size = tiles_of(look.shape).size;
            number = size.x * size.y * size.z;
        }
        tiles[i] = number;
    }
}
