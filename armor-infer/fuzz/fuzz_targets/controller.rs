#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| armor_infer_fuzz::controller::run(data));
