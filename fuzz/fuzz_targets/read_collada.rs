#![no_main]

mod reader;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| reader::read(trixel_io::read::MeshFormat::Collada, bytes));
