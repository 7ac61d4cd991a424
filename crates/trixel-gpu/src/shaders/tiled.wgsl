// [VP] J. Pantaleoni, *VoxelPipe: A Programmable Pipeline for 3D Voxelization*, 2011: one workgroup a tile, which blends its
// triangles' voxels in its own memory and writes each word once.
//
// A tile with many triangles is shared by several workgroups, so the words are still joined by atomics: one a word that has
// any voxel, where the other strategies need one or more for each triangle and column.

struct Shares {
    invocations: u32,
    pairs: u32,
    starts: array<u32>,
}

@group(1) @binding(0) var<storage, read> pairs: array<vec2<u32>>;
@group(1) @binding(1) var<storage, read> shares: Shares;

fn blend(t: Triangle) {
    let rect = column_rect(t.base, t.extent, t.flags & AXIS_MASK);
    for (var b = rect.y; b <= rect.w; b++) {
        for (var a = rect.x; a <= rect.z; a++) {
            _ = voxelize_column(t, a, b);
        }
    }
}

// Goes through a share with all invocations of the workgroup.
fn blend_share(start: u32, local: u32) {
    let tile = pairs[start].x;
    let low = tile_numbered(tile) << TILE_SHIFT;
    let high = low + (vec3<i32>(1) << TILE_SHIFT) - 1;
    tile_low = max(low, vec3<i32>(params.slab_x, 0, 0));
    tile_high = min(high, vec3<i32>(params.slab_x + params.slab_nx - 1, params.dims.yz - 1));
    let end = min((start / SHARE + 1u) * SHARE, shares.pairs);
    for (var i = start + local; i < end; i += WORKGROUP) {
        let pair = pairs[i];
        if pair.x != tile {
            break;
        }
        let shape = shape_of(corners(pair.y));
        if (shape.flags & EMPTY) == 0u {
            paint_with(pair.y);
            blend(triangle_of(shape));
        }
    }
}

@compute @workgroup_size(WORKGROUP)
fn tiled(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let share = group.y * groups.x + group.x;
    let there = share < shares.invocations / WORKGROUP;
    for (var i = local; i < TILE_WORDS; i += WORKGROUP) {
        atomicStore(&tile_words[i], 0u);
        begin_targets_of(i);
    }
    workgroupBarrier();
    if there {
        blend_share(shares.starts[share], local);
    }
    workgroupBarrier();
    if there {
        if COUNTING {
            count(COUNT_INVOCATIONS, 1u);
        }
        let corner = tile_numbered(pairs[shares.starts[share]].x) << TILE_SHIFT;
        for (var i = local; i < TILE_WORDS; i += WORKGROUP) {
            let bits = atomicLoad(&tile_words[i]);
            if bits != 0u {
                let column = corner.xy + vec2<i32>(column_of(i));
                if MODE == SOLID {
                    flip_voxels(column, u32(corner.z) >> 5u, bits);
                } else {
                    or_voxels(column, u32(corner.z) >> 5u, bits);
                }
                write_targets(i, vec3<u32>(vec2<u32>(column), u32(corner.z)), bits);
            }
        }
        flush_counters();
    }
    count_lanes(local);
}
