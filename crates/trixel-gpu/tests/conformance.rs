//! Every strategy against the definitions, on two software drivers.
//!
//! Both drivers must be installed: a missing one fails the tests (`scripts/test` installs them).

#![expect(clippy::panic, reason = "a failure here is a failed test")]

use std::sync::LazyLock;

use trixel::lattice::LatticeMesh;
use trixel::{Backend, Error, Job, Mode, Strategy, Volume};
use trixel_gpu::{AdapterChoice, Cutoff, Dilation, Gpu, GpuBackend, Heuristic, Options};

fn open(name: &str) -> Gpu {
    Gpu::open(&AdapterChoice::Named(name.to_owned())).unwrap_or_else(|error| panic!("{name}: {error}"))
}

static LAVAPIPE: LazyLock<Gpu> = LazyLock::new(|| open("llvmpipe"));
static SWIFTSHADER: LazyLock<Gpu> = LazyLock::new(|| open("SwiftShader"));

/// One strategy, with its options, as a backend.
struct One {
    backend: GpuBackend,
    strategy: Strategy,
}

impl Backend for One {
    fn name(&self) -> &'static str {
        self.backend.name()
    }

    fn strategies(&self) -> &'static [Strategy] {
        self.backend.strategies()
    }

    fn modes(&self) -> &'static [Mode] {
        self.strategy.modes()
    }

    fn voxelize(&self, mesh: &LatticeMesh<'_>, job: &Job, volume: &mut Volume) -> Result<Strategy, Error> {
        self.backend.voxelize(mesh, &job.with_strategy(self.strategy), volume)
    }
}

fn one(gpu: &Gpu, strategy: Strategy, options: Options) -> One {
    One { backend: GpuBackend::new(gpu.clone(), options), strategy }
}

fn plain(gpu: &Gpu, strategy: Strategy) -> One {
    one(gpu, strategy, Options { count: true, ..Options::default() })
}

/// A hybrid that uses both of its paths on small meshes.
fn hybrid(gpu: &Gpu, strategy: Strategy) -> One {
    let cutoff = Cutoff { heuristic: Heuristic::ProjectedArea, value: 2.0 };
    one(gpu, strategy, Options { cutoff: Some(cutoff), ..Options::default() })
}

fn dilated(gpu: &Gpu, dilation: Dilation) -> One {
    one(gpu, Strategy::FragmentParallel, Options { dilation, ..Options::default() })
}

/// Copies of many vertices each.
fn sliced_hull(gpu: &Gpu) -> One {
    one(gpu, Strategy::Sliced, Options { dilation: Dilation::HasselgrenHull, ..Options::default() })
}

mod lavapipe {
    use super::*;

    trixel::conformance_suite!(batched triangle_parallel, plain(&LAVAPIPE, Strategy::TriangleParallel));
    trixel::conformance_suite!(batched fragment_parallel, plain(&LAVAPIPE, Strategy::FragmentParallel));
    trixel::conformance_suite!(batched hasselgren_hull, dilated(&LAVAPIPE, Dilation::HasselgrenHull));
    trixel::conformance_suite!(batched hertel, dilated(&LAVAPIPE, Dilation::Hertel));
    trixel::conformance_suite!(batched hybrid_, hybrid(&LAVAPIPE, Strategy::Hybrid));
    trixel::conformance_suite!(batched hybrid_two_pass, hybrid(&LAVAPIPE, Strategy::HybridTwoPass));
    trixel::conformance_suite!(batched balanced, plain(&LAVAPIPE, Strategy::Balanced));
    trixel::conformance_suite!(batched case_sorted, plain(&LAVAPIPE, Strategy::CaseSorted));
    trixel::conformance_suite!(batched tiled, plain(&LAVAPIPE, Strategy::Tiled));
    trixel::conformance_suite!(sliced sliced, plain(&LAVAPIPE, Strategy::Sliced));
    trixel::conformance_suite!(sliced sliced_hasselgren_hull, sliced_hull(&LAVAPIPE));
    trixel::conformance_suite!(sliced slice_per_pass, plain(&LAVAPIPE, Strategy::SlicePerPass));
}

mod swiftshader {
    use super::*;

    trixel::conformance_suite!(batched triangle_parallel, plain(&SWIFTSHADER, Strategy::TriangleParallel));
    trixel::conformance_suite!(batched fragment_parallel, plain(&SWIFTSHADER, Strategy::FragmentParallel));
    trixel::conformance_suite!(batched hasselgren_hull, dilated(&SWIFTSHADER, Dilation::HasselgrenHull));
    trixel::conformance_suite!(batched hertel, dilated(&SWIFTSHADER, Dilation::Hertel));
    trixel::conformance_suite!(batched hybrid_, hybrid(&SWIFTSHADER, Strategy::Hybrid));
    trixel::conformance_suite!(batched hybrid_two_pass, hybrid(&SWIFTSHADER, Strategy::HybridTwoPass));
    trixel::conformance_suite!(batched balanced, plain(&SWIFTSHADER, Strategy::Balanced));
    trixel::conformance_suite!(batched case_sorted, plain(&SWIFTSHADER, Strategy::CaseSorted));
    trixel::conformance_suite!(batched tiled, plain(&SWIFTSHADER, Strategy::Tiled));
    trixel::conformance_suite!(sliced sliced, plain(&SWIFTSHADER, Strategy::Sliced));
    trixel::conformance_suite!(sliced slice_per_pass, plain(&SWIFTSHADER, Strategy::SlicePerPass));
}
