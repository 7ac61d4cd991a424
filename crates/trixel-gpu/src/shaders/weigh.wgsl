// One invocation a fragment: a triangle in a voxel. Adds it to the voxel's state, in integers, so that the order of
// invocations does not matter.

// As `locate.wgsl` leaves them; the free word becomes what decides who wins.
@group(0) @binding(1) var<storage, read_write> fragments: array<u32>;

fn add(at: u32, value: vec2<u32>) {
    let before = atomicAdd(&state[at], value.x);
    let high = value.y + select(0u, 1u, before + value.x < before);
    if high != 0u {
        atomicAdd(&state[at + 1u], high);
    }
}

fn add_times(at: u32, value: u32, weight: u32) {
    add(at, mul_u32(value, weight));
}

fn add_vector(at: u32, v: vec3<i32>, weight: u32) {
    add(at, i64_mul(v.x, i32(weight)));
    add(at + 2u, i64_mul(v.y, i32(weight)));
    add(at + 4u, i64_mul(v.z, i32(weight)));
}

fn add_row(cell: u32, row: Row, weight: u32) {
    if COMBINE == AREA_WEIGHTED {
        add(cell + SUM_WEIGHT, vec2<u32>(weight, 0u));
    }
    if WANT_COLOR {
        let c = row.color;
        add_times(cell + SUM_COLOR, select(multiply(c.x, c.w), c.x, c.w == FULL), weight);
        add_times(cell + SUM_COLOR + 2u, select(multiply(c.y, c.w), c.y, c.w == FULL), weight);
        add_times(cell + SUM_COLOR + 4u, select(multiply(c.z, c.w), c.z, c.w == FULL), weight);
        add_times(cell + SUM_COLOR + 6u, c.w, weight);
    }
    if WANT_NORMAL {
        add_vector(cell + SUM_NORMAL, row.normal, weight);
    }
    if WANT_GEOMETRIC_NORMAL {
        add_vector(cell + SUM_GEOMETRIC_NORMAL, row.geometric_normal, weight);
    }
    if WANT_EMISSION {
        add_times(cell + SUM_EMISSION, row.emission.x, weight);
        add_times(cell + SUM_EMISSION + 2u, row.emission.y, weight);
        add_times(cell + SUM_EMISSION + 4u, row.emission.z, weight);
    }
    if WANT_METALLIC_ROUGHNESS {
        add_times(cell + SUM_METALLIC_ROUGHNESS, row.metallic_roughness.x, weight);
        add_times(cell + SUM_METALLIC_ROUGHNESS + 2u, row.metallic_roughness.y, weight);
    }
}

fn raise_vector(at: u32, v: vec3<i32>) {
    let biased = vec3<u32>(v + vec3<i32>(BIAS));
    atomicMax(&state[at], biased.x);
    atomicMax(&state[at + 1u], biased.y);
    atomicMax(&state[at + 2u], biased.z);
}

fn take_largest(cell: u32, row: Row) {
    if WANT_COLOR {
        atomicMax(&state[cell + SUM_COLOR], row.color.x);
        atomicMax(&state[cell + SUM_COLOR + 1u], row.color.y);
        atomicMax(&state[cell + SUM_COLOR + 2u], row.color.z);
        atomicMax(&state[cell + SUM_COLOR + 3u], row.color.w);
    }
    if WANT_NORMAL {
        raise_vector(cell + SUM_NORMAL, row.normal);
    }
    if WANT_GEOMETRIC_NORMAL {
        raise_vector(cell + SUM_GEOMETRIC_NORMAL, row.geometric_normal);
    }
    if WANT_EMISSION {
        atomicMax(&state[cell + SUM_EMISSION], row.emission.x);
        atomicMax(&state[cell + SUM_EMISSION + 1u], row.emission.y);
        atomicMax(&state[cell + SUM_EMISSION + 2u], row.emission.z);
    }
    if WANT_METALLIC_ROUGHNESS {
        atomicMax(&state[cell + SUM_METALLIC_ROUGHNESS], row.metallic_roughness.x);
        atomicMax(&state[cell + SUM_METALLIC_ROUGHNESS + 1u], row.metallic_roughness.y);
    }
}

// A fragment that the alpha test has passed.
struct Seen {
    there: bool,
    at: u32,
    place: u32,
    triangle: u32,
    voxel: vec3<i32>,
    p: Patch,
    n: Nearest,
    w: vec3<u32>,
}

fn see(i: u32) -> Seen {
    var s: Seen;
    s.at = 4u + 3u * i;
    if i >= work.items {
        return s;
    }
    s.triangle = fragments[s.at + 2u];
    if s.triangle == NOTHING {
        return s;
    }
    s.place = fragments[s.at];
    s.p = patch_of(s.triangle);
    s.voxel = voxel_at(s.place);
    s.n = nearest_of(corners_of(s.p));
    s.w = weights_at(s.n, s.voxel);
    s.there = true;
    if is_masked(s.p) {
        s.there = color_of(s.p, s.w).there;
        if !s.there {
            fragments[s.at + 2u] = NOTHING;
        }
    }
    return s;
}

// Where materials have priorities, before anything is added: the highest in each voxel.
@compute @workgroup_size(WORKGROUP)
fn prioritize(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let s = see(invocation(group, groups, local));
    if s.there {
        atomicMax(&state[s.place * STATE_WORDS + STATE_PRIORITY], priority_of(s.p));
    }
}

@compute @workgroup_size(WORKGROUP)
fn weigh(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let s = see(invocation(group, groups, local));
    if !s.there {
        return;
    }
    let cell = s.place * STATE_WORDS;
    if PRIORITIES && atomicLoad(&state[cell + STATE_PRIORITY]) != priority_of(s.p) {
        fragments[s.at + 2u] = NOTHING;
        return;
    }
    atomicAdd(&state[cell + STATE_COUNT], 1u);
    var most = 0u;
    if COMBINE == AREA_WEIGHTED || COMBINE == DOMINANT {
        most = doubled_area(corners_of(s.p), s.voxel);
    } else if COMBINE == MEAN || COMBINE == NEAREST {
        most = ~distance_at(s.n, s.voxel, s.w);
    } else if COMBINE == MAX {
        most = s.triangle;
    }
    fragments[s.at + 1u] = most;
    if COMBINE != FIRST && COMBINE != ALL {
        atomicMax(&state[cell + STATE_MOST], most);
    }
    if COMBINE == MEAN || COMBINE == AREA_WEIGHTED {
        add_row(cell, row_of(s.p, s.triangle, s.w), select(1u, max(most, 1u), COMBINE == AREA_WEIGHTED));
    } else if COMBINE == MAX {
        take_largest(cell, row_of(s.p, s.triangle, s.w));
    }
}
