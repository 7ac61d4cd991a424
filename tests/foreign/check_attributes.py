"""Reads volumes with attributes that trixel wrote with readers that others wrote, and compares every value.

Usage: check_attributes.py FOLDER

FOLDER holds one volume as `volume.npz`, `sparse.npz`, `volume.vti`, `points.ply`, `volume.ply` and `volume.glb`; what is expected lies
beside them, made without trixel's writers: `expected.json` (dims, types and numbers of each attribute, names of the
materials), `indices.bin` (i4, N x 3, sorted) and `NAME.bin` for each attribute (one row a set voxel).
"""

import json
import pathlib
import subprocess
import sys

import numpy as np
import pyvista
import trimesh

HERE = pathlib.Path(__file__).parent


def main(folder):
    expected = json.loads((folder / "expected.json").read_text())
    indices = np.fromfile(folder / "indices.bin", dtype="<i4").reshape(-1, 3)
    at = tuple(indices.T)
    rows = {}
    for name, (dtype, channels) in expected["attributes"].items():
        values = np.fromfile(folder / f"{name}.bin", dtype=dtype)
        rows[name] = values.reshape(-1, channels) if channels > 1 else values
        assert len(rows[name]) == len(indices)

    with np.load(folder / "volume.npz") as arrays, np.load(folder / "sparse.npz") as sparse:
        assert np.array_equal(sparse["indices"], indices)
        for name, values in rows.items():
            key = name.replace("-", "_")
            assert arrays[key].dtype == sparse[key].dtype == values.dtype, name
            assert np.array_equal(arrays[key][at], values, equal_nan=True), f"{name} in volume.npz"
            assert np.array_equal(sparse[key], values, equal_nan=True), f"{name} in sparse.npz"
        assert arrays["material_names"].tolist() == sparse["material_names"].tolist() == expected["material_names"]

    image = pyvista.read(folder / "volume.vti")
    for name, values in rows.items():
        cells = image.cell_data[name.replace("-", "_")]
        cells = cells.reshape(expected["dims"] + list(cells.shape[1:]), order="F")
        assert cells.dtype == values.dtype, name
        assert np.array_equal(cells[at], values), f"{name} in volume.vti"

    shown = rows["color"]
    points = trimesh.load(folder / "points.ply")
    assert np.array_equal(points.colors, shown), "colours of points.ply"
    palette = {tuple(color) for color in shown[:, :3].tolist()}
    mesh = trimesh.load(folder / "volume.ply", process=False, force="mesh")
    # The voxels' own colours and no other; a hidden voxel shows none.
    assert {tuple(color) for color in mesh.visual.face_colors[:, :3].tolist()} <= palette
    (block,) = pyvista.read(folder / "volume.glb").recursive_iterator()
    linear = np.unique(block.point_data["COLOR_0"][:, :3], axis=0)
    # glTF has linear light, to 16 bits at least.
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    back = np.round(255 * encoded).astype(int)
    assert len(linear) > 1 and {tuple(color) for color in back.tolist()} <= palette, "colours of volume.glb"

    command = ["node", str(HERE / "validate_glb.js"), str(folder / "volume.glb")]
    result = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    assert result.returncode == 0, result.stdout


if __name__ == "__main__":
    main(pathlib.Path(sys.argv[1]))
