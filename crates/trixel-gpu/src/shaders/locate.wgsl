// The places of fragments' voxels.

// Three words each after four others: a voxel and a triangle's place in its chunk; then the voxel's place in the batch, one
// word free, and the triangle's number, NOTHING where it does not count.
@group(0) @binding(3) var<storage, read_write> fragments: array<u32>;

const NOTHING: u32 = 0xffffffffu;

@compute @workgroup_size(WORKGROUP)
fn locate_fragments(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let i = invocation(group, groups, local);
    if i >= locate.items {
        return;
    }
    let at = 4u + 3u * i;
    let voxel = voxel_of(vec2<u32>(fragments[at], fragments[at + 1u]));
    let place = place_of(voxel);
    let triangle = fragments[at + 2u] + locate.first_triangle;
    // A solid's shell reaches beyond its voxels.
    fragments[at + 2u] = select(NOTHING, triangle, place.there);
    fragments[at] = place.number;
}

// How many of a slab's voxels come before each plane of constant x; `fragments` takes the numbers.
@compute @workgroup_size(WORKGROUP)
fn count_before_planes(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let i = invocation(group, groups, local);
    if i < locate.items {
        fragments[i] = before_word(i * locate.ny * locate.column_words);
    }
}
