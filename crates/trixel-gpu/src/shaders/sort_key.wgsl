// What a list is sorted by. ORDER is prepended.

const XYZ: u32 = 0u;
const MORTON: u32 = 1u;
// Any two words.
const PAIRS: u32 = 2u;

// Puts two zeros between each two of the ten lowest bits.
fn spread(coordinate: u32) -> u32 {
    var bits = coordinate & 0x3ffu;
    bits = (bits | (bits << 16u)) & 0x030000ffu;
    bits = (bits | (bits << 8u)) & 0x0300f00fu;
    bits = (bits | (bits << 4u)) & 0x030c30c3u;
    return (bits | (bits << 2u)) & 0x09249249u;
}

fn morton_30(voxel: vec3<u32>) -> u32 {
    return (spread(voxel.x) << 2u) | (spread(voxel.y) << 1u) | spread(voxel.z);
}

// `high` above the lowest `bits` bits of `low`, fewer than 32, in two words, low first.
fn join(high: u32, low: u32, bits: u32) -> vec2<u32> {
    return vec2<u32>(low | (high << bits), select(high >> ((32u - bits) & 31u), 0u, bits == 0u));
}

// The key of an entry of a grid with so many bits of y and z; low word first.
fn key_of(entry: vec2<u32>, y_bits: u32, z_bits: u32) -> vec2<u32> {
    if ORDER == PAIRS {
        return join(entry.x, entry.y, z_bits);
    }
    let voxel = voxel_of(entry);
    if ORDER == MORTON {
        let low = morton_30(voxel);
        let high = morton_30(voxel >> vec3<u32>(10u));
        return vec2<u32>(low | (high << 30u), high >> 2u);
    }
    return join(voxel.x, (voxel.y << z_bits) | voxel.z, y_bits + z_bits);
}
