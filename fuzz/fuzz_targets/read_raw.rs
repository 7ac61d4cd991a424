#![no_main]

mod volume_reader;

// The `.json` file, a zero byte, the `.raw` file.
libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let (sidecar, bytes) = bytes.split_at(bytes.iter().position(|&byte| byte == 0).unwrap_or(bytes.len()));
    volume_reader::read(trixel_io::VolumeFormat::Raw, bytes.get(1..).unwrap_or_default(), Some(sidecar));
});
