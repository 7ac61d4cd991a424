// The list of set voxels by a HistoPyramid: G. Ziegler et al., *On-the-fly Point Clouds through Histogram Pyramids*, 2006;
// [HCV] 3.4. Each cell of a level counts the voxels of four cells of the one below, the lowest those of four words. Then
// every entry of the list finds its voxel alone, from the top down.

struct Pyramid {
    // Where each level's cells begin, four levels a vector, each level a multiple of four cells long.
    starts: array<vec4<u32>, 4>,
    levels: u32,
    // The level being summed, and its cells.
    level: u32,
    cells: u32,
}

@group(0) @binding(2) var<uniform> pyramid: Pyramid;
@group(0) @binding(3) var<storage, read_write> sums: array<u32>;
@group(0) @binding(4) var<storage, read_write> list: array<vec2<u32>>;

fn start_of(level: u32) -> u32 {
    return pyramid.starts[level >> 2u][level & 3u];
}

fn word(i: u32) -> u32 {
    if i < slab.words {
        return voxels[i];
    }
    return 0u;
}

@compute @workgroup_size(WORKGROUP)
fn sum_words(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let cell = invocation(group, groups, local);
    if cell < pyramid.cells {
        let counts = countOneBits(vec4<u32>(
            word(4u * cell), word(4u * cell + 1u), word(4u * cell + 2u), word(4u * cell + 3u),
        ));
        sums[start_of(0u) + cell] = counts.x + counts.y + counts.z + counts.w;
    }
}

@compute @workgroup_size(WORKGROUP)
fn sum_cells(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let cell = invocation(group, groups, local);
    if cell < pyramid.cells {
        let below = start_of(pyramid.level - 1u) + 4u * cell;
        sums[start_of(pyramid.level) + cell] = sums[below] + sums[below + 1u] + sums[below + 2u] + sums[below + 3u];
    }
}

// The place of the k-th set bit.
fn nth_bit(bits: u32, k: u32) -> u32 {
    var rest = bits;
    var left = k;
    var place = 0u;
    for (var width = 16u; width > 0u; width >>= 1u) {
        let lower = countOneBits(rest & ((1u << width) - 1u));
        if left >= lower {
            left -= lower;
            rest >>= width;
            place += width;
        }
    }
    return place;
}

@compute @workgroup_size(WORKGROUP)
fn traverse(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let entry = invocation(group, groups, local);
    if entry >= slab.voxels {
        return;
    }
    var left = entry;
    var cell = 0u;
    for (var level = pyramid.levels - 1u; level > 0u; level--) {
        let below = start_of(level - 1u);
        cell *= 4u;
        while left >= sums[below + cell] {
            left -= sums[below + cell];
            cell++;
        }
    }
    var i = 4u * cell;
    var bits = word(i);
    while left >= countOneBits(bits) {
        left -= countOneBits(bits);
        i++;
        bits = word(i);
    }
    let voxel = voxel_of_word(i) + vec3<u32>(0u, 0u, nth_bit(bits, left));
    list[slab.first + entry] = entry_of(voxel);
}
