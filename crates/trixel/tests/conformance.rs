//! The CPU backend against the definitions.

use trixel::{CpuBackend, Instructions};

trixel::conformance_suite!(cpu_all_threads, CpuBackend::default());
trixel::conformance_suite!(cpu_one_thread, CpuBackend::with_threads(1).unwrap());
trixel::conformance_suite!(cpu_three_threads, CpuBackend::with_threads(3).unwrap());
trixel::conformance_suite!(cpu_avx2, CpuBackend::default().limited_to(Instructions::Avx2));
trixel::conformance_suite!(cpu_sse42, CpuBackend::default().limited_to(Instructions::Sse42));
trixel::conformance_suite!(cpu_sse2, CpuBackend::default().limited_to(Instructions::Sse2));
