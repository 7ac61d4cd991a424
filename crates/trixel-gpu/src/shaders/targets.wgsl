// [VP] J. Pantaleoni, *VoxelPipe: A Programmable Pipeline for 3D Voxelization*, 2011: render targets, values of a tile's voxels
// that triangles blend in the workgroup's own memory. Then every voxel that is set goes to a list with its values.
//
// `begin_values`, `blend_values` and `painted_by` are prepended, for the targets asked for.

// Rows of a voxel's entry and its values; those of a voxel that several workgroups have come several times.
struct Rows {
    count: atomic<u32>,
    // How many rows there is room for; the count goes on beyond it.
    capacity: u32,
    // Not 0 when the count has passed 2^32.
    wrapped: atomic<u32>,
    unused: u32,
    words: array<u32>,
}

@group(2) @binding(0) var<storage, read_write> rows: Rows;
// What the caller gave for each triangle.
@group(2) @binding(1) var<storage, read> given: array<u32>;

// TARGETS words a voxel, z fastest.
var<workgroup> values: array<atomic<u32>, TILE_WORDS * 32u * TARGETS>;

var<private> painted: Painted;

fn begin_targets_of(word: u32) {
    for (var bit = 0u; bit < 32u; bit++) {
        begin_values((word * 32u + bit) * TARGETS);
    }
}

// What the voxels that follow are painted with.
fn paint_with(triangle: u32) {
    painted = painted_by(params.first_triangle + triangle);
}

fn paint(word: u32, bits: u32) {
    for (var rest = bits; rest != 0u; rest &= rest - 1u) {
        blend_values((word * 32u + firstTrailingBit(rest)) * TARGETS, painted);
    }
}

// Appends the voxels of a word, the lowest of which is given, with their values.
fn write_targets(word: u32, lowest: vec3<u32>, bits: u32) {
    let number = countOneBits(bits);
    var place = atomicAdd(&rows.count, number);
    if place + number < place {
        atomicStore(&rows.wrapped, 1u);
    }
    for (var rest = bits; rest != 0u; rest &= rest - 1u) {
        if place < rows.capacity {
            let bit = firstTrailingBit(rest);
            let entry = entry_of(lowest + vec3<u32>(0u, 0u, bit));
            let at = (2u + TARGETS) * place;
            rows.words[at] = entry.x;
            rows.words[at + 1u] = entry.y;
            for (var t = 0u; t < TARGETS; t++) {
                rows.words[at + 2u + t] = atomicLoad(&values[(word * 32u + bit) * TARGETS + t]);
            }
        }
        place++;
    }
}
