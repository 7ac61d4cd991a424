//! The CPU backend against the definitions.

use trixel::CpuBackend;

trixel::conformance_suite!(cpu_all_threads, CpuBackend::default());
trixel::conformance_suite!(cpu_one_thread, CpuBackend::with_threads(1).unwrap());
trixel::conformance_suite!(cpu_three_threads, CpuBackend::with_threads(3).unwrap());
