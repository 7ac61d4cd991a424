use super::read;
use crate::read::testing::check_model;

#[test]
fn real_mesh_has_the_triangles_and_box_it_is_known_for() {
    check_model("duck/duck.dae", read, 4212, [-69.299, 9.9294, -61.328], [96.18, 163.97, 53.925]);
}
