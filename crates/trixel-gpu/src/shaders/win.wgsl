// Who wins a voxel, once it is known what decides: of equals the lowest triangle.

struct Win {
    items: u32,
}

@group(0) @binding(0) var<uniform> win: Win;
// As `weigh.wgsl` leaves them.
@group(0) @binding(1) var<storage, read> fragments: array<u32>;
@group(0) @binding(3) var<storage, read_write> state: array<atomic<u32>>;

@compute @workgroup_size(WORKGROUP)
fn choose_winners(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let i = invocation(group, groups, local);
    if i >= win.items {
        return;
    }
    let at = 4u + 3u * i;
    let triangle = fragments[at + 2u];
    if triangle == 0xffffffffu {
        return;
    }
    let cell = fragments[at] * STATE_WORDS;
    if fragments[at + 1u] == atomicLoad(&state[cell]) {
        atomicMax(&state[cell + 1u], ~triangle);
    }
}
