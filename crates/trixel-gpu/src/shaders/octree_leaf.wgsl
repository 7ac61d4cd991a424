// A voxel of an octree with attributes: its sRGB colour, and its normal as integers of 15 bits, made positive. All zeros, which
// new buffers hold, when it has no attributes.

const BIAS: i32 = 65536;

fn leaf_of(color: u32, normal: vec3<i32>) -> vec4<u32> {
    return vec4<u32>(color, vec3<u32>(normal + vec3<i32>(BIAS)));
}

fn is_bare(leaf: vec4<u32>) -> bool {
    return leaf.y == 0u;
}

fn normal_of(leaf: vec4<u32>) -> vec3<i32> {
    return vec3<i32>(leaf.yzw) - vec3<i32>(BIAS);
}
