//! The papers' own numbers, in milliseconds. Facts of theirs, on hardware of theirs.

/// One row of \[HCV\] table 4.1: thin voxelization on an NVIDIA GeForce GTX 480.
#[derive(Clone, Copy, Debug)]
pub struct HcvRow {
    /// The model.
    pub model: &'static str,
    /// Its triangles.
    pub triangles: u64,
    /// Voxels along a side.
    pub resolution: u32,
    /// The triangle-parallel approach.
    pub triangle_parallel: f64,
    /// The fragment-parallel approach.
    pub fragment_parallel: f64,
    /// The hybrid.
    pub hybrid: f64,
    /// The hybrid's cutoff, in square voxels.
    pub cutoff: f64,
    /// Schwarz and Seidel 2010, where they gave one.
    pub schwarz_seidel: Option<f64>,
    /// VoxelPipe (Pantaleoni 2011), where given.
    pub voxel_pipe: Option<f64>,
}

/// The hardware of [`HCV`].
pub const HCV_HARDWARE: &str = "NVIDIA GeForce GTX 480, Intel Core i7 950; thin; Rauwendaal 2012, table 4.1";

/// \[HCV\] table 4.1.
pub const HCV: [HcvRow; 15] = {
    const LARGE: (&str, u64) = ("large triangle", 1);
    const ASIAN: (&str, u64) = ("XYZ RGB Asian Dragon", 7_219_045);
    const SPONZA: (&str, u64) = ("Crytek Sponza Atrium", 262_267);
    const BUNNY: (&str, u64) = ("Stanford Bunny", 69_666);
    const CONFERENCE: (&str, u64) = ("Conference", 331_179);
    [
        row(LARGE, 128, [10.62, 0.03, 0.05, 2.0], [None, None]),
        row(LARGE, 256, [42.4, 0.06, 0.07, 2.0], [None, None]),
        row(LARGE, 512, [169.7, 0.32, 0.32, 2.0], [None, None]),
        row(ASIAN, 128, [6.37, 165.2, 8.54, 2.0], [Some(11.36), Some(21.2)]),
        row(ASIAN, 256, [7.70, 165.0, 8.59, 2.0], [Some(14.73), None]),
        row(ASIAN, 512, [9.55, 164.6, 10.19, 2.0], [Some(16.67), Some(23.6)]),
        row(SPONZA, 128, [13.4, 10.65, 1.07, 3.1], [None, None]),
        row(SPONZA, 256, [53.2, 11.13, 1.75, 3.5], [None, None]),
        row(SPONZA, 512, [208.7, 11.87, 3.84, 3.1], [None, None]),
        row(BUNNY, 128, [0.28, 1.58, 0.19, 2.0], [Some(0.60), None]),
        row(BUNNY, 256, [0.82, 1.55, 0.53, 2.5], [Some(0.89), None]),
        row(BUNNY, 512, [3.12, 1.82, 1.91, 0.0], [Some(2.35), None]),
        row(CONFERENCE, 128, [9.23, 11.47, 1.48, 2.0], [Some(3.9), Some(3.3)]),
        row(CONFERENCE, 256, [36.04, 11.62, 1.73, 2.0], [None, None]),
        row(CONFERENCE, 512, [141.2, 11.94, 3.01, 2.0], [Some(59.3), Some(8.5)]),
    ]
};

/// One row of \[CL\] table 1: both algorithms at 128, 256 and 512.
#[derive(Clone, Copy, Debug)]
pub struct ClRow {
    /// The model.
    pub model: &'static str,
    /// Its triangles.
    pub triangles: u64,
    /// The paper's own.
    pub sliced: [f64; 3],
    /// The mesh once per slice, after Llamas 2007.
    pub slice_per_pass: [f64; 3],
}

/// The hardware of [`CL`].
pub const CL_HARDWARE: &str = "ATI HD5850, Intel Core 2 Duo E6750; Chang and Lai 2011, table 1";

/// The resolutions of [`CL`].
pub const CL_RESOLUTIONS: [u32; 3] = [128, 256, 512];

/// \[CL\] table 1.
pub const CL: [ClRow; 6] = [
    cl_row("Torus", 800, [1.66, 3.73, 10.91], [2.67, 7.29, 641.03]),
    cl_row("Venusm", 43_357, [3.19, 5.04, 12.41], [12.41, 73.02, 746.27]),
    cl_row("Horse", 96_966, [4.28, 7.65, 15.09], [15.09, 156.99, 925.93]),
    cl_row("Hand", 654_666, [11.5, 20.0, 27.68], [27.68, 632.91, 2500.0]),
    cl_row("Dragon", 871_414, [16.54, 23.85, 31.06], [31.06, 1282.05, 3448.28]),
    cl_row("Happy", 1_087_716, [16.36, 24.71, 31.58], [31.58, 1724.14, 4347.82]),
];

const fn cl_row(model: &'static str, triangles: u64, sliced: [f64; 3], slice_per_pass: [f64; 3]) -> ClRow {
    ClRow { model, triangles, sliced, slice_per_pass }
}

const fn row(
    (model, triangles): (&'static str, u64),
    resolution: u32,
    [triangle_parallel, fragment_parallel, hybrid, cutoff]: [f64; 4],
    [schwarz_seidel, voxel_pipe]: [Option<f64>; 2],
) -> HcvRow {
    HcvRow {
        model,
        triangles,
        resolution,
        triangle_parallel,
        fragment_parallel,
        hybrid,
        cutoff,
        schwarz_seidel,
        voxel_pipe,
    }
}
