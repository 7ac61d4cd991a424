use super::read;
use crate::read::testing::check_model;

#[test]
fn real_meshes_have_the_triangles_and_boxes_they_are_known_for() {
    check_model("cad/counterXP.3MF", read, 83_750, [-111.49, 5.7792, 255.86], [193.31, 310.19, 281.7]);
    check_model("cad/pyramids.3mf", read, 3276, [5.0123, 5.0236, 10.025], [351.74, 168.11, 35.025]);
}
