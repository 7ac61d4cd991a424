// The list of set voxels by prefix population counts: blocks of words are counted, the counts summed up (`scan.wgsl`), and
// each block then knows where its voxels go. The twin of `rank.rs`.

@group(0) @binding(2) var<storage, read_write> blocks: array<u32>;
@group(0) @binding(3) var<storage, read_write> list: array<vec2<u32>>;

const BLOCK_WORDS: u32 = 8u;

@compute @workgroup_size(WORKGROUP)
fn count_bits(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let start = invocation(group, groups, local) * BLOCK_WORDS;
    if start >= slab.words {
        return;
    }
    var sum = 0u;
    for (var i = start; i < min(start + BLOCK_WORDS, slab.words); i++) {
        sum += countOneBits(voxels[i]);
    }
    blocks[start / BLOCK_WORDS] = sum;
}

@compute @workgroup_size(WORKGROUP)
fn write_list(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let start = invocation(group, groups, local) * BLOCK_WORDS;
    if start >= slab.words {
        return;
    }
    var place = slab.first + blocks[start / BLOCK_WORDS];
    for (var i = start; i < min(start + BLOCK_WORDS, slab.words); i++) {
        let lowest = entry_of(voxel_of_word(i));
        for (var rest = voxels[i]; rest != 0u; rest &= rest - 1u) {
            list[place] = lowest + vec2<u32>(0u, firstTrailingBit(rest));
            place++;
        }
    }
}
