// How many triangles each case has, for the dispatches over them: three words of arguments each. MAX_GROUPS is prepended.

@group(1) @binding(0) var<storage, read> before: array<u32>;
@group(1) @binding(1) var<storage, read> total: u32;
@group(1) @binding(2) var<storage, read_write> arguments: array<u32, 12>;

@compute @workgroup_size(1)
fn case_sizes() {
    let blocks = (params.triangles + WORKGROUP - 1u) / WORKGROUP;
    for (var c = 0u; c < 4u; c++) {
        var end = total;
        if c < 3u {
            end = before[(c + 1u) * blocks];
        }
        let groups = (end - before[c * blocks] + WORKGROUP - 1u) / WORKGROUP;
        let width = min(groups, MAX_GROUPS);
        arguments[3u * c] = width;
        arguments[3u * c + 1u] = select(0u, (groups + width - 1u) / max(width, 1u), width > 0u);
        arguments[3u * c + 2u] = 1u;
    }
}
