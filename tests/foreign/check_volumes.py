"""Reads volumes that trixel wrote with readers that others wrote, and compares voxels and grid.

Usage: check_volumes.py FOLDER

Each sub-folder of FOLDER holds one volume in every format, as `volume.EXTENSION` (and `sparse.npz`, `points.ply`), with what is
expected beside them, made without trixel's writers: `expected.json` (grid, up axis, surface area and volume) and
`expected.bin` (one byte a voxel, [x, y, z] in C order).
"""

import json
import pathlib
import subprocess
import sys

import nrrd
import numpy as np
import pyvista
import trimesh
import zarr
from trimesh.exchange import binvox

HERE = pathlib.Path(__file__).parent


class Expected:
    def __init__(self, folder):
        values = json.loads((folder / "expected.json").read_text())
        self.dims = np.array(values["dims"])
        self.origin = np.array(values["origin"])
        self.voxel_size = np.array(values["voxel_size"])
        self.up = values["up"]
        self.area = values["area"]
        self.volume = values["volume"]
        self.occupancy = np.fromfile(folder / "expected.bin", dtype=bool).reshape(self.dims)

    def check(self, occupancy, origin, voxel_size):
        assert occupancy.shape == tuple(self.dims), f"shape {occupancy.shape}, not {self.dims}"
        assert np.array_equal(occupancy, self.occupancy), f"{np.sum(occupancy != self.occupancy)} voxels differ"
        assert np.array_equal(origin, self.origin), f"origin {origin}, not {self.origin}"
        assert np.array_equal(voxel_size, self.voxel_size), f"voxel size {voxel_size}, not {self.voxel_size}"


def check_npz(path, expected):
    with np.load(path) as arrays:
        assert sorted(arrays.files) == ["occupancy", "origin", "voxel_size"]
        assert arrays["occupancy"].dtype == bool
        assert arrays["origin"].dtype == arrays["voxel_size"].dtype == np.float64
        expected.check(arrays["occupancy"], arrays["origin"], arrays["voxel_size"])


def check_sparse(path, expected):
    with np.load(path) as arrays:
        assert sorted(arrays.files) == ["dims", "indices", "origin", "voxel_size"]
        indices = arrays["indices"]
        assert indices.dtype == np.int32 and indices.shape[1:] == (3,)
        # argwhere sorts by x, y, z too.
        assert np.array_equal(indices, np.argwhere(expected.occupancy))
        occupancy = np.zeros(arrays["dims"], dtype=bool)
        occupancy[tuple(indices.T)] = True
        expected.check(occupancy, arrays["origin"], arrays["voxel_size"])


def check_zarr(path, expected):
    array = zarr.open_group(path, mode="r")["occupancy"]
    assert array.dtype == bool and array.metadata.zarr_format == 3
    assert array.metadata.dimension_names == ("x", "y", "z")
    assert array.chunks == (64, 64, 64) and array.shards is not None
    expected.check(array[:], array.attrs["origin"], array.attrs["voxel_size"])


def check_npy(path, expected):
    occupancy = np.load(path)
    assert occupancy.dtype == bool
    expected.check(occupancy, expected.origin, expected.voxel_size)


def check_raw(path, expected):
    sidecar = json.loads(path.with_suffix(".json").read_text())
    assert (sidecar["dtype"], sidecar["order"], sidecar["axes"]) == ("uint8", "C", "x,y,z")
    assert sidecar["file"] == path.name
    values = np.fromfile(path, dtype=np.uint8).reshape(sidecar["dims"])
    assert values.max() <= 1
    assert sidecar["count"] == values.sum()
    expected.check(values.astype(bool), sidecar["origin"], sidecar["voxel_size"])


def check_binvox(path, expected):
    with path.open("rb") as file:
        header = binvox.parse_binvox(file)
    side = max(expected.dims)
    assert tuple(header.shape) == (side, side, side), header.shape
    with path.open("rb") as file, np.errstate(all="ignore"):
        matrix = binvox.load_binvox(file).matrix
    cube = np.zeros((side, side, side), dtype=bool)
    x, y, z = expected.dims
    cube[:x, :y, :z] = expected.occupancy
    assert np.array_equal(matrix, cube), f"{np.sum(matrix != cube)} voxels differ"
    # trimesh's own transform takes `scale` for the distance of the outermost centres; the format says the cube's edge.
    expected.check(expected.occupancy, header.translate, np.full(3, header.scale / side))


def check_vti(path, expected):
    image = pyvista.read(path)
    assert tuple(image.dimensions) == tuple(expected.dims + 1), image.dimensions
    values = image.cell_data["occupancy"]
    assert values.dtype == np.uint8
    assert image.cell_data.active_scalars_name == "occupancy"
    expected.check(values.reshape(expected.dims, order="F") == 1, image.origin, image.spacing)


def check_nrrd(path, expected):
    values, header = nrrd.read(str(path))
    assert values.dtype == np.uint8 and header["encoding"] == "gzip"
    directions = header["space directions"]
    assert np.array_equal(directions, np.diag(np.diag(directions)))
    centre = expected.origin + expected.voxel_size / 2
    assert np.array_equal(header["space origin"], centre), header["space origin"]
    corner = np.array(header["trixel origin"].split(), dtype=float)
    expected.check(values == 1, corner, np.diag(directions))


def crossings(triangles, expected, axis):
    """Occupancy from the faces across one axis alone: each opens or closes the voxels behind it."""
    u, v = (axis + 1) % 3, (axis + 2) % 3
    local = (triangles - expected.origin) / expected.voxel_size
    corners = np.round(local).astype(np.int64)
    assert np.abs(local - corners).max(initial=0) < 1e-6, "a corner is not on the grid"
    corners = corners[np.ptp(corners[:, :, axis], axis=1) == 0]
    plane, flat = corners[:, 0, axis], corners[:, :, [u, v]]
    low, high = flat.min(axis=1), flat.max(axis=1)
    # Twice the area, positive for counter-clockwise triangles, which look along +axis.
    a, b = flat[:, 1] - flat[:, 0], flat[:, 2] - flat[:, 0]
    signed = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    # Each is one half of its box, cut along a diagonal: the corner at the right angle adds up with the diagonal's ends.
    assert np.array_equal(np.abs(signed), np.prod(high - low, axis=1)), "a triangle is not half a rectangle"
    right = flat.sum(axis=1) - low - high
    # Two halves that face each other across the diagonal make a rectangle.
    sign = np.sign(signed)
    order = np.lexsort((right[:, 1], right[:, 0], sign, *high.T, *low.T, plane))
    plane, low, high, right, sign = (values[order] for values in (plane, low, high, right, sign))
    for values in (plane, low, high, sign):
        assert np.array_equal(values[::2], values[1::2]), "a half of a rectangle is missing"
    assert np.array_equal(right[::2] + right[1::2], (low + high)[::2]), "a half of a rectangle is there twice"
    plane, low, high, sign = plane[::2], low[::2], high[::2], sign[::2]
    covered = np.zeros(expected.dims[[axis, u, v]] + 1, dtype=np.int64)
    for (i, j), weight in (((low, low), 1), ((high, low), -1), ((low, high), -1), ((high, high), 1)):
        # A face that looks along +axis ends the voxels before it.
        np.add.at(covered, (plane, i[:, 0], j[:, 1]), -weight * sign)
    covered = covered.cumsum(axis=1).cumsum(axis=2)
    assert np.abs(covered).max() <= 1, "a face is covered twice"
    filled = covered.cumsum(axis=0)
    assert not filled[-1].any(), "a column does not end"
    occupancy = filled[:-1, :-1, :-1].transpose([(0 - axis) % 3, (1 - axis) % 3, (2 - axis) % 3])
    assert occupancy.min() >= 0 and occupancy.max() <= 1
    return occupancy.astype(bool)


def check_surface(mesh, expected):
    for axis in range(3):
        found = crossings(mesh.triangles, expected, axis)
        assert np.array_equal(found, expected.occupancy), f"axis {axis}: {np.sum(found != expected.occupancy)} voxels"
    assert np.isclose(mesh.area, expected.area, rtol=1e-9), f"area {mesh.area}, not {expected.area}"
    volume = trimesh.triangles.mass_properties(mesh.triangles - expected.origin).volume
    assert np.isclose(volume, expected.volume, rtol=1e-9), f"volume {volume}, not {expected.volume}"


def load_mesh(path):
    return trimesh.load(path, process=False, force="mesh")


def check_mesh(path, expected):
    mesh = load_mesh(path)
    if path.suffix != ".stl":
        assert len(np.unique(mesh.vertices, axis=0)) == len(mesh.vertices), "vertices are not shared"
    check_surface(mesh, expected)


def check_points(path, expected):
    loaded = trimesh.load(path)
    # A scene without anything in it where there are no points.
    points = getattr(loaded, "vertices", np.zeros((0, 3)))
    # argwhere sorts by x, y, z too.
    centres = expected.origin + (np.argwhere(expected.occupancy) + 0.5) * expected.voxel_size
    assert np.array_equal(points, centres)


def check_glb(path, expected):
    # The scene, so that the node's transform counts; it turns up to y.
    scene = trimesh.load(path, force="scene")
    mesh = scene.to_geometry() if hasattr(scene, "to_geometry") else scene.dump(concatenate=True)
    turn = {
        "x": [[0, -1, 0], [1, 0, 0], [0, 0, 1]],
        "y": [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
        "z": [[1, 0, 0], [0, 0, 1], [0, -1, 0]],
    }[expected.up]
    up = np.eye(3)["xyz".index(expected.up)]
    assert np.array_equal(np.array(turn) @ up, [0, 1, 0]) and np.linalg.det(turn) == 1
    back = np.eye(4)
    back[:3, :3] = np.transpose(turn)
    mesh.apply_transform(back)
    check_surface(mesh, expected)


def check_empty(path):
    """A surface without faces is a file that readers take, or say to be empty."""
    try:
        mesh = load_mesh(path)
    except ValueError as error:
        assert "empty" in str(error).lower() or "no " in str(error).lower(), error
        return
    assert len(mesh.faces) == 0


CHECKS = {
    "volume.npz": check_npz,
    "sparse.npz": check_sparse,
    "points.ply": check_points,
    "volume.zarr": check_zarr,
    "volume.npy": check_npy,
    "volume.raw": check_raw,
    "volume.binvox": check_binvox,
    "volume.vti": check_vti,
    "volume.nrrd": check_nrrd,
    "volume.obj": check_mesh,
    "volume.ply": check_mesh,
    "volume.stl": check_mesh,
    "volume.glb": check_glb,
}
SURFACES = {"volume.obj", "volume.ply", "volume.stl", "volume.glb"}


def check_glbs(paths):
    command = ["node", str(HERE / "validate_glb.js"), *map(str, paths)]
    result = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    if "Cannot find module" in result.stdout:
        sys.exit("gltf-validator is missing: run `npm ci` in tests/foreign")
    return [f"glTF validator: {line}" for line in result.stdout.splitlines()] if result.returncode else []


def main(root):
    failures, checked = [], 0
    for folder in sorted(path for path in root.iterdir() if path.is_dir()):
        expected = Expected(folder)
        for name, check in CHECKS.items():
            path = folder / name
            if name == "volume.binvox" and len(set(expected.voxel_size)) > 1:
                continue
            try:
                if name in SURFACES and not expected.occupancy.any():
                    check_empty(path)
                else:
                    check(path, expected)
                checked += 1
            except Exception as error:
                failures.append(f"{folder.name}/{name}: {type(error).__name__}: {error}")
    failures += check_glbs(sorted(root.glob("*/volume.glb")))
    print(f"{checked} files checked, {len(failures)} failures", *failures, sep="\n")
    return 1 if failures or not checked else 0


if __name__ == "__main__":
    sys.exit(main(pathlib.Path(sys.argv[1])))
