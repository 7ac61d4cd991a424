// One invocation a voxel: its winner's row, with means or maxima in place of what can be added up. Only where the winner is
// one of the chunk's triangles.

// A sum over two words.
fn sum_at(at: u32) -> vec2<u32> {
    return vec2<u32>(atomicLoad(&state[at]), atomicLoad(&state[at + 1u]));
}

fn half_of(a: vec2<u32>) -> vec2<u32> {
    return i64_shift_right(a, 1u);
}

fn mean(at: u32, weight: vec2<u32>) -> u32 {
    return u64_divide(i64_add(sum_at(at), half_of(weight)), weight);
}

// A colour component whose sum was multiplied by alpha.
fn straight(at: u32, alpha_sum: vec2<u32>) -> u32 {
    let shift = max(u64_bits(alpha_sum), 32u) - 32u;
    let sum = i64_shift_right(sum_at(at), shift).x;
    let alpha = i64_shift_right(alpha_sum, shift).x;
    let value = u64_divide(i64_add(mul_u32(sum, FULL), vec2<u32>(alpha / 2u, 0u)), vec2<u32>(max(alpha, 1u), 0u));
    return min(value, FULL);
}

fn vector_sum(at: u32) -> Vector {
    return Vector(sum_at(at), sum_at(at + 2u), sum_at(at + 4u));
}

fn largest_at(at: u32) -> vec2<u32> {
    return i64_from(bitcast<i32>(atomicLoad(&state[at])) - BIAS);
}

fn vector_of_largest(at: u32) -> Vector {
    return Vector(largest_at(at), largest_at(at + 1u), largest_at(at + 2u));
}

// Sheets that face each other's backs cancel out: then the winner's normal stays.
fn along_or(v: Vector, own: vec3<i32>) -> vec3<i32> {
    let n = normalized(v);
    return select(own, n.xyz, n.w != 0);
}

fn means(cell: u32, own: Row) -> Row {
    var row = own;
    var weight = vec2<u32>(atomicLoad(&state[cell + STATE_COUNT]), 0u);
    if COMBINE == AREA_WEIGHTED {
        weight = sum_at(cell + SUM_WEIGHT);
    }
    if WANT_COLOR {
        let at = cell + SUM_COLOR;
        let alpha = sum_at(at + 6u);
        row.color = vec4<u32>(
            straight(at, alpha),
            straight(at + 2u, alpha),
            straight(at + 4u, alpha),
            min(mean(at + 6u, weight), FULL),
        );
    }
    if WANT_NORMAL {
        row.normal = along_or(vector_sum(cell + SUM_NORMAL), own.normal);
    }
    if WANT_GEOMETRIC_NORMAL {
        row.geometric_normal = along_or(vector_sum(cell + SUM_GEOMETRIC_NORMAL), own.geometric_normal);
    }
    if WANT_EMISSION {
        let at = cell + SUM_EMISSION;
        row.emission = vec3<u32>(mean(at, weight), mean(at + 2u, weight), mean(at + 4u, weight));
    }
    if WANT_METALLIC_ROUGHNESS {
        let at = cell + SUM_METALLIC_ROUGHNESS;
        row.metallic_roughness = vec2<u32>(mean(at, weight), mean(at + 2u, weight));
    }
    return row;
}

fn maxima(cell: u32, own: Row) -> Row {
    var row = own;
    if WANT_COLOR {
        let at = cell + SUM_COLOR;
        row.color = vec4<u32>(
            atomicLoad(&state[at]),
            atomicLoad(&state[at + 1u]),
            atomicLoad(&state[at + 2u]),
            atomicLoad(&state[at + 3u]),
        );
    }
    if WANT_NORMAL {
        row.normal = along_or(vector_of_largest(cell + SUM_NORMAL), own.normal);
    }
    if WANT_GEOMETRIC_NORMAL {
        row.geometric_normal = along_or(vector_of_largest(cell + SUM_GEOMETRIC_NORMAL), own.geometric_normal);
    }
    if WANT_EMISSION {
        let at = cell + SUM_EMISSION;
        row.emission = vec3<u32>(atomicLoad(&state[at]), atomicLoad(&state[at + 1u]), atomicLoad(&state[at + 2u]));
    }
    if WANT_METALLIC_ROUGHNESS {
        let at = cell + SUM_METALLIC_ROUGHNESS;
        row.metallic_roughness = vec2<u32>(atomicLoad(&state[at]), atomicLoad(&state[at + 1u]));
    }
    return row;
}

@compute @workgroup_size(WORKGROUP)
fn write_voxel_rows(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let place = invocation(group, groups, local);
    if place >= work.items {
        return;
    }
    let cell = place * STATE_WORDS;
    if atomicLoad(&state[cell + STATE_COUNT]) == 0u {
        if work.first_triangle == 0u {
            var nothing: Row;
            nothing.triangle = NOTHING;
            nothing.material = NOTHING;
            put_row(work.first_voxel + place, nothing);
        }
        return;
    }
    let winner = ~atomicLoad(&state[cell + STATE_WINNER]);
    if winner - work.first_triangle >= work.triangles {
        return;
    }
    let p = patch_of(winner);
    let w = weights_at(nearest_of(corners_of(p)), voxel_at(place));
    var row = row_of(p, winner, w);
    if COMBINE == MEAN || COMBINE == AREA_WEIGHTED {
        row = means(cell, row);
    } else if COMBINE == MAX {
        row = maxima(cell, row);
    }
    put_row(work.first_voxel + place, row);
}
