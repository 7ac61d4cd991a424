// The number of an invocation in a dispatch of two dimensions, which large ones need.

const WORKGROUP: u32 = 64u;

fn invocation(group: vec3<u32>, groups: vec3<u32>, local: u32) -> u32 {
    return (group.y * groups.x + group.x) * WORKGROUP + local;
}
