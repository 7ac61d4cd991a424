"""Writes one volume with writers that others wrote, for trixel's readers.

Usage: write_volumes.py FOLDER

`expected.bin` gets one byte a voxel, [x, y, z] in C order; the grid is the one below, which the test knows too.
"""

import pathlib
import sys

import nrrd
import numpy as np
import pyvista
import trimesh
import vtk

DIMS = (7, 70, 131)
ORIGIN = np.array([-3.5, 10.25, 1e3])
VOXEL_SIZE = np.array([0.25, 0.5, 1.5])


def write_numpy(folder, occupancy):
    grid = {"origin": ORIGIN, "voxel_size": VOXEL_SIZE}
    np.savez(folder / "stored.npz", occupancy=occupancy, **grid)
    np.savez_compressed(folder / "deflated.npz", occupancy=occupancy, **grid)
    np.savez_compressed(folder / "fortran.npz", occupancy=np.asfortranarray(occupancy), **grid)
    np.savez_compressed(folder / "bytes.npz", occupancy=occupancy.astype(np.uint8) * 7, **grid)
    np.savez_compressed(folder / "signed.npz", occupancy=-occupancy.astype(np.int8), **grid)
    for dtype in ("int32", "int64", "uint32", "uint16"):
        # argwhere gives Fortran order, and astype keeps it.
        indices = np.argwhere(occupancy).astype(dtype)
        assert indices.flags.f_contiguous
        np.savez_compressed(folder / f"sparse_{dtype}.npz", indices=indices, dims=DIMS, **grid)
    shuffled = np.random.default_rng(2).permutation(np.ascontiguousarray(np.argwhere(occupancy)))
    np.savez(folder / "sparse_c_unsorted.npz", indices=shuffled, dims=DIMS, **grid)
    np.save(folder / "c.npy", occupancy)
    np.save(folder / "fortran.npy", np.asfortranarray(occupancy))


def write_binvox(folder, occupancy):
    # trimesh exports the array as it is; the format wants a cube.
    side = max(DIMS)
    cube = np.zeros((side, side, side), dtype=bool)
    cube[tuple(slice(n) for n in DIMS)] = occupancy
    voxels = trimesh.voxel.VoxelGrid(cube)
    (folder / "trimesh.binvox").write_bytes(voxels.export(file_type="binvox"))


def write_vti(folder, occupancy):
    for dtype in (np.uint8, np.int8, np.float32, np.float64, np.int32):
        image = pyvista.ImageData(dimensions=np.array(DIMS) + 1, origin=ORIGIN, spacing=VOXEL_SIZE)
        values = occupancy.flatten(order="F").astype(dtype)
        if values.dtype.kind == "f":
            values[values == 0] = -0.0
        image.cell_data["occupancy"] = values
        name = np.dtype(dtype).name
        image.save(folder / f"pyvista_{name}.vti")
        for mode in ("ascii", "binary", "appended_raw", "appended_base64"):
            for compressed in (False, True):
                writer = vtk.vtkXMLImageDataWriter()
                writer.SetInputData(image)
                writer.SetFileName(str(folder / f"vtk_{name}_{mode}_{'zlib' if compressed else 'plain'}.vti"))
                if mode == "ascii":
                    writer.SetDataModeToAscii()
                elif mode == "binary":
                    writer.SetDataModeToBinary()
                else:
                    writer.SetDataModeToAppended()
                    writer.SetEncodeAppendedData(mode == "appended_base64")
                if compressed:
                    writer.SetCompressorTypeToZLib()
                else:
                    writer.SetCompressorTypeToNone()
                assert writer.Write() == 1
    # Big-endian, 32-bit headers, an extent that does not begin at 0, and other arrays before the right one.
    image = pyvista.ImageData(origin=ORIGIN - VOXEL_SIZE * [2, 0, 4], spacing=VOXEL_SIZE)
    image.SetExtent(2, DIMS[0] + 2, 0, DIMS[1], 4, DIMS[2] + 4)
    image.cell_data["other"] = np.ones(occupancy.size)
    image.cell_data["occupancy"] = occupancy.flatten(order="F").astype(np.uint8)
    image.point_data["points"] = np.ones(image.n_points)
    writer = vtk.vtkXMLImageDataWriter()
    writer.SetInputData(image)
    writer.SetFileName(str(folder / "vtk_other_order.vti"))
    writer.SetByteOrderToBigEndian()
    writer.SetHeaderTypeToUInt32()
    assert writer.Write() == 1
    # Refused by name.
    writer.SetFileName(str(folder / "refused_lz4.vti"))
    writer.SetCompressorTypeToLZ4()
    assert writer.Write() == 1


def write_nrrd(folder, occupancy):
    values = occupancy.astype(np.uint8)
    space = {
        "space": "left-posterior-superior",
        "space directions": np.diag(VOXEL_SIZE),
        "space origin": ORIGIN + VOXEL_SIZE / 2,
    }
    for encoding in ("raw", "gzip", "ascii"):
        nrrd.write(str(folder / f"{encoding}.nrrd"), values, {**space, "encoding": encoding})
    nrrd.write(str(folder / "signed.nrrd"), -values.astype(np.int8), {**space, "encoding": "gzip"})
    axes = {"spacings": VOXEL_SIZE, "axis mins": ORIGIN, "centerings": ["cell"] * 3}
    nrrd.write(str(folder / "axes.nrrd"), values, axes)
    nrrd.write(str(folder / "refused_bzip2.nrrd"), values, {**space, "encoding": "bzip2"})
    nrrd.write(str(folder / "refused_float.nrrd"), values.astype(np.float32), space)


def main(folder):
    occupancy = np.random.default_rng(1).random(DIMS) < 0.3
    occupancy.astype(np.uint8).tofile(folder / "expected.bin")
    write_numpy(folder, occupancy)
    write_binvox(folder, occupancy)
    write_vti(folder, occupancy)
    write_nrrd(folder, occupancy)


if __name__ == "__main__":
    main(pathlib.Path(sys.argv[1]))
