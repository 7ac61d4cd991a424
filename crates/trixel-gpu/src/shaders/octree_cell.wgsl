// What is at a voxel of an octree.

fn place_of(voxel: vec3<u32>) -> Place {
    let found = descend(voxel, 0u);
    return Place(found.content == FULL, found.level);
}
