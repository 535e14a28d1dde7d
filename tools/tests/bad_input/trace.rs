//! Inputs of a trace that do not fit the bundle.

use super::common::{golden_path, tiny};
use safetensors::tensor::TensorView;
use safetensors::{Dtype, SafeTensors};
use visavis::ErrorKind;
use visavis_tools::trace::TraceInput;

/// A file of f32 tensors of the given shapes, every element `value`.
fn file(tensors: &[(&str, &[usize])], value: f32) -> Vec<u8> {
    let data: Vec<_> = tensors.iter().map(|(_, shape)| value.to_le_bytes().repeat(shape.iter().product())).collect();
    let views = tensors.iter().zip(&data).map(|((name, shape), data)| {
        (*name, TensorView::new(Dtype::F32, shape.to_vec(), data).expect("a sound tensor"))
    });
    safetensors::serialize(views, None).expect("a file")
}

#[test]
fn what_does_not_fit_is_named() {
    let engine = tiny();
    let latent = engine.config().vae.latent;
    let idle = engine.idle_blocks();
    for (tensors, part) in [
        (&[("something", &[3][..])][..], "0 blocks"),
        (&[("user_path", &[8, 2][..])], "user_path has shape [8, 2], expected [any, 3]"),
        (&[("agent_voice", &[1, 9][..])], "agent_voice has shape"),
        (&[("gaze", &[2][..]), ("user_path", &[4, 3])], "gaze has shape"),
        (&[("eps", &[5, latent + 1][..])], "eps has shape"),
        (&[("eps", &[5, latent][..])], "without eps_idle"),
        (&[("eps_idle", &[idle, latent][..]), ("user_path", &[4, 3])], "without eps;"),
        (&[("eps", &[5, latent][..]), ("eps_idle", &[idle + 1, latent])], "eps_idle has shape"),
        (&[("user_path", &[40_000, 3][..])], "not 1 to"),
    ] {
        let e = TraceInput::parse(&file(tensors, 0.5), &engine).unwrap_err();
        assert_eq!(e.kind(), ErrorKind::Argument);
        assert!(e.to_string().contains(part), "expected `{part}`: {e}");
    }
    let e = TraceInput::parse(&file(&[("user_path", &[4, 3])], f32::NAN), &engine).unwrap_err();
    assert!(e.to_string().contains("user_path holds NaN at element 0"), "{e}");
}

#[test]
fn damaged_files_are_refused() {
    let engine = tiny();
    let path = golden_path("tiny-golden.safetensors");
    let bytes = std::fs::read(&path).unwrap();
    assert!(SafeTensors::deserialize(&bytes).is_ok());
    for len in (0..bytes.len()).step_by(4999) {
        let e = TraceInput::parse(&bytes[..len], &engine).unwrap_err();
        assert!(e.kind() == ErrorKind::Argument && e.to_string().contains("not a safetensors file"), "{e}");
    }
    let e = TraceInput::read("no/such.safetensors", &engine).unwrap_err();
    assert!(e.kind() == ErrorKind::Io && e.to_string().starts_with("no/such.safetensors"), "{e}");
    assert_eq!(TraceInput::read(&path, &engine).unwrap().blocks, 20);
}
