//! `case-sorted`, after M. Schwarz and H.-P. Seidel, *Fast Parallel Surface and Solid Voxelization on GPUs*, 2010: triangles
//! sorted by whether their boxes extend along one, two or three axes, then one dispatch a case.

use super::{Recorder, bind, run, run_indirect_at};
use crate::error::GpuError;
use crate::layout::Unit;
use crate::limits::WORKGROUP;
use crate::shader::{BoxCase, Stage};

impl Recorder<'_> {
    pub(super) fn case_sorted(&mut self, unit: &Unit<'_>) -> Result<(), GpuError> {
        let gpu = self.setting.gpu;
        let layouts = gpu.pipelines().layouts();
        let triangles = unit.chunk.triangles;
        let numbers = |triangles: u32| 4 * triangles.div_ceil(WORKGROUP);
        let buffers = self.setting.scratch.cases(gpu, self.capacity)?;
        let scan = self.setting.scratch.scan(gpu, numbers(self.capacity))?;
        let sums = self.prefix_sums(&scan, numbers(triangles))?;
        let counts = &scan.levels[0];

        let whole = wgpu::Buffer::as_entire_binding;
        let classified = bind(gpu, &layouts.list_write, &[&buffers.cases, counts].map(whole));
        let placed = bind(gpu, &layouts.cases, &[&buffers.cases, counts, &buffers.sorted].map(whole));
        let sized = bind(gpu, &layouts.cases, &[counts, &scan.total, &buffers.arguments].map(whole));
        let read = bind(gpu, &layouts.case_sorted, &[counts, &scan.total, &buffers.sorted].map(whole));
        let [classify, sort, sizes] =
            [Stage::ClassifyCases, Stage::SortCases, Stage::CaseSizes].map(|stage| self.pipeline(stage));
        let cases = BoxCase::ALL.map(|case| (case, self.pipeline(Stage::CaseSorted(case))));
        let groups = self.groups(triangles);

        let mut pass = self.pass("sort by case");
        run(&mut pass, &classify, &unit.bind_group, Some(unit.parameters), Some(&classified), groups);
        sums.record(&mut pass);
        run(&mut pass, &sort, &unit.bind_group, Some(unit.parameters), Some(&placed), groups);
        run(&mut pass, &sizes, &unit.bind_group, Some(unit.parameters), Some(&sized), [1, 1]);
        drop(pass);
        let mut pass = self.pass("case-sorted");
        for (case, pipeline) in &cases {
            let later_shares = if *case == BoxCase::Long { unit.later_shares.as_slice() } else { &[] };
            for share in [unit.parameters].iter().chain(later_shares) {
                let arguments = (&buffers.arguments, 12 * u64::from(case.code()));
                run_indirect_at(&mut pass, pipeline, &unit.bind_group, *share, &read, arguments);
            }
        }
        Ok(())
    }
}
