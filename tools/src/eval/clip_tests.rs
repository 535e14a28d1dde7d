//! Clips survive the way to disk; what is no clip is refused by name.

use super::*;
use crate::synthetic;
use safetensors::tensor::TensorView;
use visavis::ErrorKind;

fn folder(name: &str) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("visavis-clip-{name}-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

/// The bytes of a clip of `frames` frames: positions, rotations, user and the agent's voice.
fn bytes(frames: usize, change: impl Fn(&mut Vec<(&'static str, Dtype, Vec<usize>, Vec<u8>)>)) -> Vec<u8> {
    let recording = synthetic::walk(frames);
    let joints = || recording.frames.iter().flat_map(|f| &f.global);
    let floats = |values: Vec<f32>| values.into_iter().flat_map(f32::to_le_bytes).collect::<Vec<u8>>();
    let voice: Vec<u8> = (0..800 * frames).flat_map(|i| (i as i16).to_le_bytes()).collect();
    let user = (0..3 * frames).map(|i| i as f32).collect();
    let mut tensors = vec![
        ("positions", Dtype::F32, vec![frames, 22, 3], floats(joints().flat_map(|t| t.position.to_array()).collect())),
        ("rotations", Dtype::F32, vec![frames, 22, 4], floats(joints().flat_map(|t| t.rotation.to_array()).collect())),
        ("user_head", Dtype::F32, vec![frames, 3], floats(user)),
        ("agent_voice", Dtype::I16, vec![800 * frames], voice),
    ];
    change(&mut tensors);
    let views = tensors.iter().map(|(n, d, s, b)| (*n, TensorView::new(*d, s.clone(), b).unwrap()));
    safetensors::serialize(views, None).unwrap()
}

#[test]
fn a_part_of_a_clip_is_what_was_written() {
    let folder = folder("read");
    std::fs::write(folder.join("b.safetensors"), bytes(50, |_| {})).unwrap();
    std::fs::write(folder.join("a.safetensors"), bytes(12, |_| {})).unwrap();
    std::fs::write(folder.join("notes.txt"), "not a clip").unwrap();
    let clips = Clip::list(&folder, &Rig::humanoid()).unwrap();
    std::fs::remove_dir_all(&folder).unwrap_or(());
    assert_eq!(clips.iter().map(Clip::frames).collect::<Vec<_>>(), [12, 50], "by name");
    let file = folder.join("again.safetensors");
    std::fs::create_dir_all(&folder).unwrap();
    std::fs::write(&file, bytes(50, |_| {})).unwrap();
    let clip = Clip::open(&file, &Rig::humanoid()).unwrap();
    let part = clip.read(10, 5).unwrap();
    assert!(clip.read(46, 5).is_err(), "beyond the end");
    std::fs::remove_dir_all(&folder).unwrap();
    let whole = synthetic::walk(50);
    for (i, (a, b)) in part.frames.iter().zip(&whole.frames[10..]).enumerate() {
        assert_eq!(a.index, i as u64);
        assert!(a.global.iter().zip(&b.global).all(|(a, b)| a.position == b.position));
        assert!((a.root.yaw - b.root.yaw).abs() < 1e-6);
    }
    assert_eq!(part.user[1], Vec3::new(33.0, 34.0, 35.0));
    assert_eq!(part.agent_voice.as_ref().unwrap()[3], 8003);
    assert_eq!(part.agent_voice.as_ref().unwrap().len(), 4000);
    assert_eq!(part.user_voice, None);
    // Put elsewhere, the body keeps its shape and faces where it was told to.
    let there = Root { x: 4.0, z: -2.0, yaw: 1.0 };
    let moved = part.moved(&there);
    assert!((moved[0].root.x - 4.0).abs() < 1e-5 && (moved[0].root.yaw - 1.0).abs() < 1e-5);
    let (a, b) = (&moved[4], &part.frames[4]);
    for (a, t) in a.global.iter().map(|t| a.root.to_local(t.position)).zip(&b.global) {
        assert!(a.distance(b.root.to_local(t.position)) < 1e-5);
    }
}

#[test]
fn what_is_no_clip_is_refused_by_name() {
    let folder = folder("bad");
    let file = folder.join("clip.safetensors");
    let fails = |bytes: Vec<u8>, part: &str| {
        std::fs::write(&file, bytes).unwrap();
        let rig = Rig::humanoid();
        let e = Clip::open(&file, &rig).and_then(|clip| clip.read(0, clip.frames())).map(|_| ()).unwrap_err();
        assert_eq!((e.kind(), e.path()), (ErrorKind::Argument, Some(file.as_path())), "{e}");
        assert!(e.to_string().contains(part), "{e}");
    };
    fails(b"RIFF and so on, no clip at all".to_vec(), "begin");
    fails([&20u64.to_le_bytes()[..], b"{\"positions\": 3      "].concat(), "header");
    fails(bytes(8, |t| drop(t.remove(0))), "positions");
    fails(bytes(8, |t| drop(t.remove(2))), "user_head");
    fails(bytes(8, |t| t[1].2 = vec![8, 4, 22]), "rotations");
    fails(bytes(8, |t| t[0].3[4..8].copy_from_slice(&f32::NAN.to_le_bytes())), "finite");
    let whole = bytes(8, |_| {});
    fails(whole[..whole.len() - 100].to_vec(), "ends within");
    std::fs::remove_file(&file).unwrap();
    assert!(Clip::list(&folder, &Rig::humanoid()).unwrap_err().to_string().contains("no clips"));
    assert_eq!(Clip::list(&file, &Rig::humanoid()).unwrap_err().kind(), ErrorKind::Io);
    std::fs::remove_dir_all(&folder).unwrap();
}
