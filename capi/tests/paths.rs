//! Paths are UTF-8 on every system: spaces, umlauts, other scripts.

use std::ffi::CString;
use visavis_c::{VisavisStatus, visavis_engine_free, visavis_engine_from_path};

#[test]
fn a_bundle_may_lie_anywhere() {
    let folder = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("Wörter mit Leerzeichen 模型");
    std::fs::create_dir_all(&folder).expect("a folder");
    let path = folder.join("größe.safetensors");
    std::fs::copy(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/goldens/tiny.safetensors"), &path).expect("a copy");
    let name = CString::new(path.to_str().expect("Unicode")).expect("no NUL");
    let mut engine = std::ptr::null_mut();
    // SAFETY: a C string and a place for the engine, which is freed once.
    unsafe {
        assert_eq!(visavis_engine_from_path(name.as_ptr(), &raw mut engine), VisavisStatus::Ok);
        visavis_engine_free(engine);
    }
    std::fs::remove_dir_all(&folder).expect("an engine holds no file");
}
