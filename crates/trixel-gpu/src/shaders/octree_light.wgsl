// The tables of `light.wgsl` where there is nothing else beside them.

struct Tables {
    linear_at: u32,
    srgb_at: u32,
}

const work: Tables = Tables(0u, 128u);
@group(0) @binding(8) var<storage, read> tables: array<u32>;
