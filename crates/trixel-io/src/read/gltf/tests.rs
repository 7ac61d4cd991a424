use super::read;
use crate::read::testing::check_model;

#[test]
fn real_meshes_have_the_triangles_and_boxes_they_are_known_for() {
    check_model("sponza/Sponza.gltf", read, 262_267, [-19.209, -1.2644, -11.828], [17.999, 14.294, 11.054]);
    check_model("tree/oaktree.gltf", read, 5302, [-0.76972, -1.8586e-07, -0.81728], [0.72734, 1.9262, 0.60142]);
    check_model("cesium-man/CesiumMan.glb", read, 4672, [-0.56914, 0.0, -0.131], [0.56914, 1.5065, 0.18095]);
    check_model("morph-sphere/AnimatedMorphSphere.gltf", read, 960, [-1.0; 3], [1.0; 3]);
    check_model("duck/Duck.glb", read, 4212, [-0.69298, 0.099294, -0.61328], [0.9618, 1.6397, 0.53925]);
    check_model("engine/2CylinderEngine.glb", read, 121_496, [-371.69, -180.97, -140.0], [371.69, 92.042, 128.0]);
    check_model("vertex-colour/float_color_cube.glb", read, 48, [-1.0; 3], [1.0; 3]);
    check_model("dirty/mode5.gltf", read, 2786, [-18.506, 1.7778, 15.686], [38.644, 66.314, 91.804]);
}
