// Bricks of 8 x 8 x 8 voxels from a list along the Morton curve: the twin of `bricks.rs`, whose bits these are.

@group(0) @binding(3) var<storage, read_write> bricks: array<vec2<u32>>;
// Sixteen words a brick: x in bits 6 to 8 of a bit's number, y in 3 to 5, z below.
@group(0) @binding(4) var<storage, read_write> bits: array<atomic<u32>>;

@compute @workgroup_size(WORKGROUP)
fn write_bricks(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let i = invocation(group, groups, local);
    if i >= sparse.entries {
        return;
    }
    // Those begun before a brick's later voxels count the brick itself.
    var brick = begun[i];
    if is_first(i) {
        bricks[brick] = entry_of(cube_of(i));
    } else {
        brick -= 1u;
    }
    let inside = voxel_of(list[i]) & vec3<u32>(7u);
    let bit = (inside.x << 6u) | (inside.y << 3u) | inside.z;
    atomicOr(&bits[16u * brick + (bit >> 5u)], 1u << (bit & 31u));
}
