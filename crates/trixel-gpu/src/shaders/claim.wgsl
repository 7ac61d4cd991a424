// Which triangle a voxel is told of: the lowest number, whatever the order of fragments.

// A word a voxel of the slab, z fastest: 0 where no triangle is, else 2^32 - 1 less its number.
@group(2) @binding(0) var<storage, read_write> claims: array<atomic<u32>>;

fn claim(voxel: vec3<i32>, triangle: u32) {
    let column = u32(voxel.x - params.slab_x) * u32(params.dims.y) + u32(voxel.y);
    atomicMax(&claims[column * u32(params.dims.z) + u32(voxel.z)], 0xffffffffu - triangle);
}
