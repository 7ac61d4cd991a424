// An entry of a voxel list: x and y in the halves of the first word, z in the second.

fn entry_of(voxel: vec3<u32>) -> vec2<u32> {
    return vec2<u32>(voxel.x | (voxel.y << 16u), voxel.z);
}

fn voxel_of(entry: vec2<u32>) -> vec3<u32> {
    return vec3<u32>(entry.x & 0xffffu, entry.x >> 16u, entry.y);
}
