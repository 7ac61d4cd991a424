// What is at a voxel of a brick map, whose places lie along the Morton curve.

@group(0) @binding(3) var<storage, read> places: array<vec2<u32>>;
@group(0) @binding(4) var<storage, read> bits: array<u32>;

fn key(place: vec3<u32>) -> vec2<u32> {
    return key_of(entry_of(place), 0u, 0u);
}

fn place_of(voxel: vec3<u32>) -> Place {
    let wanted = key(voxel >> vec3<u32>(3u));
    var low = 0u;
    var high = tree.nodes;
    while low < high {
        let middle = low + (high - low) / 2u;
        if u64_less(key_of(places[middle], 0u, 0u), wanted) {
            low = middle + 1u;
        } else {
            high = middle;
        }
    }
    if low >= tree.nodes || any(key_of(places[min(low, tree.nodes - 1u)], 0u, 0u) != wanted) {
        return Place(false, 3u);
    }
    let inside = voxel & vec3<u32>(7u);
    let bit = 64u * inside.x + 8u * inside.y + inside.z;
    return Place(((bits[16u * low + (bit >> 5u)] >> (bit & 31u)) & 1u) == 1u, 0u);
}
