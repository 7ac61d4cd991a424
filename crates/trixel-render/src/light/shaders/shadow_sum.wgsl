// Optical depths summed along the light: equation 1 of [CL], for every slice at once.

@group(0) @binding(0) var depths: texture_3d<f32>;
@group(0) @binding(1) var sums: texture_storage_3d<rgba16float, write>;

@compute @workgroup_size(8, 8)
fn sum_slices(@builtin(global_invocation_id) id: vec3<u32>) {
    let size = textureDimensions(depths);
    if id.x >= size.x || id.y >= size.y {
        return;
    }
    var sum = vec4<f32>(0.0);
    for (var slice = 0u; slice < size.z; slice++) {
        let voxel = vec3<u32>(id.xy, slice);
        sum += textureLoad(depths, voxel, 0);
        textureStore(sums, voxel, sum);
    }
}
