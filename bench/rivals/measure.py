"""Measures one Python tool on one prepared case: measure.py TOOL FOLDER MODE SECONDS THREADS; prints one JSON object.

Each tool is a function of a `Case` that gives a function of no arguments; calling that voxelizes, from the tool's own mesh in
memory to voxels in the tool's own form, and gives a function that turns these into bools of the grid, which is not timed.
"""

import json
import os
import sys
import time
from pathlib import Path

TOOL, FOLDER, MODE, SECONDS, THREADS = sys.argv[1], Path(sys.argv[2]), sys.argv[3], float(sys.argv[4]), int(sys.argv[5])
# Libraries read these when they are imported.
for name in ("OMP_NUM_THREADS", "VTK_SMP_MAX_THREADS", "ITK_GLOBAL_DEFAULT_NUMBER_OF_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ[name] = str(THREADS)

import numpy as np  # noqa: E402


class Case:
    """A mesh in voxel units, and the grid."""

    def __init__(self, folder):
        about = json.loads((folder / "case.json").read_text())
        self.folder = folder
        self.dims = about["dims"]
        self.column_bytes = about["column_bytes"]
        self.vertices = np.fromfile(folder / "vertices.f64").reshape(-1, 3)
        self.triangles = np.fromfile(folder / "triangles.u32", dtype=np.uint32).reshape(-1, 3)

    def exact(self):
        packed = np.fromfile(self.folder / f"{MODE}.bits", dtype=np.uint8).reshape(*self.dims[:2], self.column_bytes)
        return np.unpackbits(packed, axis=2, bitorder="little", count=self.dims[2]).view(bool)

    def from_indices(self, indices):
        """Bools from voxels in any order, those outside of the grid left out."""
        found = np.zeros(self.dims, dtype=bool)
        inside = ((indices >= 0) & (indices < self.dims)).all(axis=1)
        found[tuple(indices[inside].T)] = True
        return found


def open3d(case):
    import open3d as o3d

    mesh = o3d.geometry.TriangleMesh(
        o3d.utility.Vector3dVector(case.vertices), o3d.utility.Vector3iVector(case.triangles.astype(np.int32))
    )
    low, high = np.zeros(3), np.array(case.dims, dtype=float)

    def voxelize():
        grid = o3d.geometry.VoxelGrid.create_from_triangle_mesh_within_bounds(mesh, 1.0, low, high)
        return lambda: case.from_indices(np.array([voxel.grid_index for voxel in grid.get_voxels()]).reshape(-1, 3))

    return voxelize


def trimesh(case):
    import trimesh as tm

    # Its voxels have their centres on integers.
    mesh = tm.Trimesh(case.vertices - 0.5, case.triangles, process=False, validate=False)

    def voxelize():
        grid = mesh.voxelized(1.0)
        if MODE == "solid":
            grid = grid.fill()
        return lambda: case.from_indices(np.rint(grid.points).astype(np.int64))

    return voxelize


def pyvista(case):
    """PyVista's mask of the centres inside, on a mesh in doubles."""
    import pyvista as pv
    import vtk

    vtk.vtkSMPTools.Initialize(THREADS)
    faces = np.column_stack([np.full(len(case.triangles), 3), case.triangles]).astype(np.int64).ravel()
    mesh = pv.PolyData(case.vertices, faces)

    def voxelize():
        centres = pv.ImageData(dimensions=case.dims, spacing=(1, 1, 1), origin=(0.5, 0.5, 0.5))
        mask = mesh.voxelize_binary_mask(reference_volume=centres)
        return lambda: np.asarray(mask.point_data["mask"]).reshape(case.dims[::-1]).transpose(2, 1, 0).astype(bool)

    return voxelize


def itk(case):
    import itk as itk_module

    itk_module.MultiThreaderBase.SetGlobalDefaultNumberOfThreads(THREADS)
    # Its meshes hold coordinates as floats; the pixel type decides that of the image.
    mesh = itk_module.Mesh[itk_module.UC, 3].New()
    mesh.SetPoints(itk_module.vector_container_from_array(case.vertices.astype(np.float32).ravel()))
    count = len(case.triangles)
    cells = np.column_stack([np.full(count, 2), np.full(count, 3), case.triangles]).astype(np.uint64).ravel()
    mesh.SetCellsArray(itk_module.vector_container_from_array(cells))

    def voxelize():
        kind = itk_module.TriangleMeshToBinaryImageFilter[type(mesh), itk_module.Image[itk_module.UC, 3]]
        fill = kind.New(Input=mesh)
        fill.SetOrigin([0.5] * 3)
        fill.SetSpacing([1.0] * 3)
        fill.SetSize([int(side) for side in case.dims])
        fill.SetTolerance(0.0)
        fill.SetInsideValue(1)
        fill.SetOutsideValue(0)
        fill.Update()
        image = fill.GetOutput()
        return lambda: itk_module.array_from_image(image).transpose(2, 1, 0).astype(bool)

    return voxelize


def libigl(case):
    import igl

    vertices, triangles = case.vertices, case.triangles.astype(np.int64)
    axes = [np.arange(side) + 0.5 for side in case.dims]

    def voxelize():
        centres = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
        winding = igl.fast_winding_number(vertices, triangles, centres)
        return lambda: (np.abs(winding) > 0.5).reshape(case.dims)

    return voxelize


def cudavox(case):
    import CudaVox

    points = case.vertices.astype(np.float32)
    triangles = case.triangles.astype(np.int64)
    # Its solids want a cube. It grows the box that it is given by a 10001st of it on all sides, in floats; what is taken off that
    # keeps walls on the grid's border inside.
    side = max(case.dims)
    size = np.full(3, side, dtype=np.int32)
    room = side / 10003 - side * 1e-7
    low, high = np.full(3, room, np.float32), np.full(3, side - room, np.float32)

    def voxelize():
        # Grey values are written to the image, one a triangle.
        found = CudaVox.run(
            Triangles=triangles, Tetra=np.zeros((0, 4), np.int64), Greyscale=np.full((len(triangles), 2), 255, np.int64),
            Points=points, Bbox_min=low, Bbox_max=high, gridsize=size, useThrustPath=False, forceCPU=True,
            solid=MODE == "solid", use_tetra=False,
        )
        x, y, z = case.dims
        return lambda: np.asarray(found).reshape(side, side, side)[:x, :y, :z] > 0

    return voxelize


def load_open3d(path):
    import open3d as o3d

    return o3d.io.read_triangle_mesh(path)


def load_trimesh(path):
    import trimesh as tm

    return tm.load_mesh(path, process=False)


def load_pyvista(path):
    import pyvista as pv

    return pv.read(path)


def load_libigl(path):
    import igl

    return igl.readPLY(path) if hasattr(igl, "readPLY") else igl.read_triangle_mesh(path)


LOADERS = {"open3d": load_open3d, "trimesh": load_trimesh, "pyvista": load_pyvista, "libigl": load_libigl}
TOOLS = {"open3d": open3d, "trimesh": trimesh, "pyvista": pyvista, "itk": itk, "libigl": libigl, "cudavox": cudavox}


def status_bytes(name):
    status = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) * 1024 for line in status if line.startswith(name))


def load_ms():
    """Milliseconds of reading the mesh's file, by tools that do; the module is imported before."""
    if TOOL not in LOADERS:
        return None
    path = str(FOLDER / "mesh.ply")
    try:
        LOADERS[TOOL](path)
        start = time.perf_counter()
        LOADERS[TOOL](path)
        return (time.perf_counter() - start) * 1e3
    except Exception as error:
        print(f"{TOOL} cannot read {path}: {error}", file=sys.stderr)
        return None


def main():
    loading = load_ms()
    case = Case(FOLDER)
    voxelize = TOOLS[TOOL](case)
    # From here on the peak counts anew.
    Path("/proc/self/clear_refs").write_text("5")
    before = status_bytes("VmRSS:")
    times, cpu_times, begin = [], [], time.perf_counter()
    while len(times) < 11 and (not times or time.perf_counter() - begin < SECONDS):
        start, cpu_start = time.perf_counter(), time.process_time()
        voxels = voxelize()
        times.append((time.perf_counter() - start) * 1e3)
        cpu_times.append((time.process_time() - cpu_start) * 1e3)
    peak = status_bytes("VmHWM:")
    found, exact = voxels(), case.exact()
    result = {
        "load_ms": loading, "times_ms": times, "cpu_ms": cpu_times, "before_bytes": before, "peak_bytes": peak,
        "missing": int((exact & ~found).sum()), "extra": int((found & ~exact).sum()),
    }
    print(json.dumps(result))


main()
