// Turns a number of triangles into the arguments of a draw and of a dispatch over them. VERTICES is prepended.

@group(0) @binding(0) var<storage, read> counted: u32;
@group(0) @binding(1) var<storage, read_write> arguments: array<u32, 7>;

@compute @workgroup_size(1)
fn write_arguments() {
    // Beyond this, invocations or vertices could not be numbered: nothing runs, and the caller sees why.
    let number = select(counted, 0u, counted > MAX_PAIRS);
    arguments[0] = number * VERTICES;
    arguments[1] = 1u;
    arguments[2] = 0u;
    arguments[3] = 0u;
    let groups = number / 64u + select(0u, 1u, number % 64u != 0u);
    let width = min(groups, MAX_GROUPS);
    arguments[4] = width;
    arguments[5] = select(0u, (groups + width - 1u) / max(width, 1u), width > 0u);
    arguments[6] = 1u;
}
