// Bits to bytes, 255 where set, in rows along x: what a copy into a 3D texture reads.

struct Expand {
    // Voxels of the slab along x, of the grid along y, and the planes of constant z in this batch.
    size: vec3<u32>,
    first_z: u32,
    column_words: u32,
    // u32 words of a row, at the alignment of copies.
    row_words: u32,
}

@group(0) @binding(0) var<uniform> expand_params: Expand;
@group(0) @binding(1) var<storage, read> voxels: array<u32>;
@group(0) @binding(2) var<storage, read_write> bytes: array<u32>;

// Four voxels along x.
@compute @workgroup_size(64)
fn expand(@builtin(global_invocation_id) id: vec3<u32>) {
    let e = expand_params;
    if id.x >= e.row_words || id.y >= e.size.y || id.z >= e.size.z {
        return;
    }
    let z = e.first_z + id.z;
    var texels = 0u;
    for (var i = 0u; i < 4u; i++) {
        let x = 4u * id.x + i;
        if x < e.size.x {
            let word = voxels[(x * e.size.y + id.y) * e.column_words + (z >> 5u)];
            texels |= select(0u, 0xffu, ((word >> (z & 31u)) & 1u) == 1u) << (8u * i);
        }
    }
    bytes[(id.z * e.size.y + id.y) * e.row_words + id.x] = texels;
}
