// Rows of attributes: what `Values` in the library reads.

@group(0) @binding(9) var<storage, read_write> rows: array<u32>;

fn put_vector(at: u32, v: vec3<i32>) {
    rows[at] = direction_word(v.x);
    rows[at + 1u] = direction_word(v.y);
    rows[at + 2u] = direction_word(v.z);
}

fn put_row(index: u32, row: Row) {
    let at = index * ROW_WORDS;
    if WANT_COLOR {
        rows[at + ROW_COLOR] = encode(row.color);
    }
    if WANT_NORMAL {
        put_vector(at + ROW_NORMAL, row.normal);
    }
    if WANT_GEOMETRIC_NORMAL {
        put_vector(at + ROW_GEOMETRIC_NORMAL, row.geometric_normal);
    }
    if WANT_TEXCOORD {
        rows[at + ROW_TEXCOORD] = row.u.x;
        rows[at + ROW_TEXCOORD + 1u] = row.u.y;
        rows[at + ROW_TEXCOORD + 2u] = row.v.x;
        rows[at + ROW_TEXCOORD + 3u] = row.v.y;
    }
    if WANT_MATERIAL {
        rows[at + ROW_MATERIAL] = row.material;
    }
    if WANT_TRIANGLE {
        rows[at + ROW_TRIANGLE] = row.triangle;
    }
    if WANT_BARYCENTRIC {
        rows[at + ROW_BARYCENTRIC] = bitcast<u32>(f32(row.weights.x) * 0x1p-16);
        rows[at + ROW_BARYCENTRIC + 1u] = bitcast<u32>(f32(row.weights.y) * 0x1p-16);
        rows[at + ROW_BARYCENTRIC + 2u] = bitcast<u32>(f32(row.weights.z) * 0x1p-16);
    }
    if WANT_EMISSION {
        rows[at + ROW_EMISSION] = row.emission.x;
        rows[at + ROW_EMISSION + 1u] = row.emission.y;
        rows[at + ROW_EMISSION + 2u] = row.emission.z;
    }
    if WANT_METALLIC_ROUGHNESS {
        rows[at + ROW_METALLIC_ROUGHNESS] = row.metallic_roughness.x | (row.metallic_roughness.y << 16u);
    }
}
