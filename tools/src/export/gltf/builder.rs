//! A glTF document and its one binary buffer, built side by side.

use super::solid::Solid;
use super::valid;
use gltf_json::accessor::{ComponentType, GenericComponentType, Type};
use gltf_json::buffer::{Target, View};
use gltf_json::material::{PbrBaseColorFactor, PbrMetallicRoughness, StrengthFactor};
use gltf_json::mesh::{Mode, Primitive, Semantic};
use gltf_json::validation::USize64;
use gltf_json::{Accessor, Asset, Index, Material, Mesh, Node, Root, Scene, Value};
use visavis::{Error, ErrorKind, Result, Rig};

/// A glTF document under construction.
pub(in crate::export) struct Builder {
    pub(in crate::export) root: Root,
    bytes: Vec<u8>,
}

/// A node of this name.
pub(in crate::export) fn node(name: &str) -> Node {
    Node { name: Some(name.to_owned()), ..Node::default() }
}

impl Builder {
    pub(in crate::export) fn new(scene: &str) -> Self {
        let asset =
            Asset { generator: Some(concat!("visavis ", env!("CARGO_PKG_VERSION")).into()), ..Asset::default() };
        let empty = Scene { extensions: None, extras: Default::default(), name: Some(scene.into()), nodes: Vec::new() };
        let mut root = Root { asset, ..Root::default() };
        root.scene = Some(root.push(empty));
        Self { root, bytes: Vec::new() }
    }

    /// A node a joint, at rest; returns their indices in the order of the rig.
    pub(in crate::export) fn skeleton(&mut self, rig: &Rig) -> Vec<Index<Node>> {
        let first = self.root.nodes.len();
        let index = |j: usize| Index::new((first + j) as u32);
        for (j, joint) in rig.joints.iter().enumerate() {
            let children: Vec<_> = rig.children(j).map(index).collect();
            let children = (!children.is_empty()).then_some(children);
            self.root.push(Node { translation: Some(joint.offset), children, ..node(&joint.name) });
        }
        (0..rig.len()).map(index).collect()
    }

    /// What the scene shows.
    pub(in crate::export) fn scene(&mut self, nodes: Vec<Index<Node>>) {
        self.root.scenes[0].nodes = nodes;
    }

    pub(super) fn material(&mut self, name: &str, [r, g, b]: [f32; 3]) -> Index<Material> {
        let surface = PbrMetallicRoughness {
            base_color_factor: PbrBaseColorFactor([r, g, b, 1.0]),
            metallic_factor: StrengthFactor(0.0),
            roughness_factor: StrengthFactor(0.8),
            ..PbrMetallicRoughness::default()
        };
        self.root.push(Material { name: Some(name.into()), pbr_metallic_roughness: surface, ..Material::default() })
    }

    pub(super) fn mesh(&mut self, name: &str, primitives: Vec<Primitive>) -> Index<Mesh> {
        let name = Some(name.to_owned());
        self.root.push(Mesh { extensions: None, extras: Default::default(), name, primitives, weights: None })
    }

    /// The triangles of `solid`, with joints and weights when it is `skinned`.
    pub(super) fn primitive(&mut self, solid: &Solid, material: Index<Material>, skinned: bool) -> Primitive {
        let vertices = Some(Target::ArrayBuffer);
        let mut attributes = vec![
            (Semantic::Positions, self.floats(&solid.positions, Type::Vec3, vertices, true)),
            (Semantic::Normals, self.floats(&solid.normals, Type::Vec3, vertices, false)),
        ];
        if skinned {
            let joints: Vec<u8> = solid.joints.iter().flat_map(|&j| [j, 0, 0, 0]).collect();
            let count = solid.joints.len();
            let joints = self.accessor(&joints, count, (ComponentType::U8, Type::Vec4), vertices);
            let weights = vec![[1.0, 0.0, 0.0, 0.0]; count];
            attributes.push((Semantic::Joints(0), joints));
            attributes.push((Semantic::Weights(0), self.floats(&weights, Type::Vec4, vertices, false)));
        }
        let indices: Vec<u8> = solid.triangles.iter().flatten().flat_map(|i| i.to_le_bytes()).collect();
        let kind = (ComponentType::U16, Type::Scalar);
        let indices = self.accessor(&indices, solid.triangles.len() * 3, kind, Some(Target::ElementArrayBuffer));
        Primitive {
            attributes: attributes.into_iter().map(|(semantic, at)| (valid(semantic), at)).collect(),
            extensions: None,
            extras: Default::default(),
            indices: Some(indices),
            material: Some(material),
            mode: valid(Mode::Triangles),
            targets: None,
        }
    }

    /// An accessor over rows of floats in a view of its own, with their bounds where the format
    /// asks for them.
    pub(super) fn floats<const N: usize>(
        &mut self,
        rows: &[[f32; N]],
        kind: Type,
        target: Option<Target>,
        bounds: bool,
    ) -> Index<Accessor> {
        let bytes: Vec<u8> = rows.iter().flatten().flat_map(|v| v.to_le_bytes()).collect();
        let index = self.accessor(&bytes, rows.len(), (ComponentType::F32, kind), target);
        if bounds {
            let fold = |f: fn(f32, f32) -> f32| -> Option<Value> {
                let first = *rows.first()?;
                let bound = rows.iter().fold(first, |a, b| std::array::from_fn(|i| f(a[i], b[i])));
                Some(Value::from(bound.to_vec()))
            };
            let (min, max) = (fold(f32::min), fold(f32::max));
            let accessor = &mut self.root.accessors[index.value()];
            (accessor.min, accessor.max) = (min, max);
        }
        index
    }

    fn accessor(
        &mut self,
        bytes: &[u8],
        count: usize,
        (component, kind): (ComponentType, Type),
        target: Option<Target>,
    ) -> Index<Accessor> {
        let at = self.bytes.len();
        self.bytes.extend_from_slice(bytes);
        self.align(0);
        let view = self.root.push(View {
            buffer: Index::new(0),
            byte_length: USize64::from(bytes.len()),
            byte_offset: Some(USize64::from(at)),
            byte_stride: None,
            name: None,
            target: target.map(valid),
            extensions: None,
            extras: Default::default(),
        });
        self.root.push(Accessor {
            buffer_view: Some(view),
            byte_offset: None,
            count: USize64::from(count),
            component_type: valid(GenericComponentType(component)),
            extensions: None,
            extras: Default::default(),
            type_: valid(kind),
            min: None,
            max: None,
            name: None,
            normalized: false,
            sparse: None,
        })
    }

    /// Every view starts on 4 bytes, the widest component in use.
    fn align(&mut self, fill: u8) {
        let length = self.bytes.len().next_multiple_of(4);
        self.bytes.resize(length, fill);
    }

    /// The file: a 12-byte header, the JSON chunk (padded with spaces) and the BIN chunk (padded
    /// with zeros).
    pub(in crate::export) fn finish(mut self) -> Result<Vec<u8>> {
        self.root.push(gltf_json::Buffer {
            byte_length: USize64::from(self.bytes.len()),
            name: None,
            uri: None,
            extensions: None,
            extras: Default::default(),
        });
        let broken = |e: String| Error::new(ErrorKind::Argument, format!("cannot be written as glTF: {e}"));
        let mut json = gltf_json::serialize::to_vec(&self.root).map_err(|e| broken(e.to_string()))?;
        json.resize(json.len().next_multiple_of(4), b' ');
        let size = |n: usize| u32::try_from(n).map(u32::to_le_bytes);
        let total = 12 + 8 + json.len() + 8 + self.bytes.len();
        let (Ok(total), Ok(json_size), Ok(bin_size)) = (size(total), size(json.len()), size(self.bytes.len())) else {
            return Err(broken("the recording is too long for the 4 GiB of a .glb file; export it in parts".into()));
        };
        let version = 2u32.to_le_bytes();
        let head = [&b"glTF"[..], &version, &total, &json_size, b"JSON"].concat();
        Ok([&head, &json, &bin_size[..], b"BIN\0", &self.bytes].concat())
    }
}
