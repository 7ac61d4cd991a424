// Instead of `targets.wgsl` where tiles hold nothing but bits.

fn begin_targets_of(word: u32) {
}

fn paint_with(triangle: u32) {
}

fn paint(word: u32, bits: u32) {
}

fn write_targets(word: u32, lowest: vec3<u32>, bits: u32) {
}
