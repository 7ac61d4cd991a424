#![no_main]

mod volume_reader;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| volume_reader::read(trixel_io::VolumeFormat::Npz, bytes, None));
