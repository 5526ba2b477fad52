//! Rewrites an ONNX file so that all networks of a stage can share its weights.
//!
//! OpenVINO copies a constant for every network that has to convert or transpose it: weights in 16
//! bits before a `Cast`, and those of a `MatMul`, which it needs transposed. Here both happen once,
//! before the graph is read. Values and their order of summation stay the same.

use std::collections::{HashMap, HashSet};

use half::f16;
use onnx_rs::ast::{Attribute, AttributeType, DataType, Graph, Node, OpType, OperatorSetId, TensorProto};

/// The domain of `FusedMatMul`, a `MatMul` that may transpose its inputs.
const MICROSOFT: &str = "com.microsoft";

/// The file with weights in 32 bits, and those of products transposed. None if the file is not
/// understood.
pub(super) fn shareable(file: &[u8]) -> Option<Vec<u8>> {
    let mut model = onnx_rs::parse(file).ok()?;
    let graph = model.graph.as_mut()?;
    // A graph inside a node may use names of this one.
    let has_graph = |attribute: &Attribute<'_>| attribute.g.is_some() || !attribute.graphs.is_empty();
    if graph.node.iter().any(|node| node.attribute.iter().any(has_graph)) {
        return None;
    }
    convert(graph);
    transpose(graph);
    let used: HashSet<&str> = graph.node.iter().flat_map(|node| &node.input).copied().collect();
    graph.initializer.retain(|tensor| used.contains(tensor.name()));
    if model.opset_import.iter().all(|opset| opset.domain != MICROSOFT) {
        let (domain, version) = (MICROSOFT, 1);
        model.opset_import.push(OperatorSetId { domain, version });
    }
    Some(onnx_rs::encode(&model))
}

/// Replaces every `Cast` of 16-bit weights by the same weights in 32 bits.
fn convert<'a>(graph: &mut Graph<'a>) {
    let halves: HashMap<&str, &TensorProto<'a>> = graph
        .initializer
        .iter()
        .filter(|tensor| tensor.data_type() == DataType::Float16)
        .map(|tensor| (tensor.name(), tensor))
        .collect();
    let mut converted: HashMap<&'a str, TensorProto<'a>> = HashMap::new();
    for node in graph.node.iter().filter(|node| casts_to_float(node)) {
        let weights = node.input.first().and_then(|name| halves.get(name));
        if let (Some(weights), Some(&name)) = (weights, node.output.first())
            && let (bytes, []) = weights.as_raw().unwrap_or_default().as_chunks::<2>()
        {
            let values = bytes.iter().map(|bytes| f16::from_le_bytes(*bytes).to_f32());
            converted.insert(
                name,
                TensorProto::from_f32(name, weights.dims().to_vec(), values.collect()),
            );
        }
    }
    graph.node.retain(|node| {
        node.output
            .first()
            .is_none_or(|name| !converted.contains_key(name))
    });
    graph.initializer.extend(converted.into_values());
}

fn casts_to_float(node: &Node<'_>) -> bool {
    let to = node.attribute.iter().find(|attribute| attribute.name == "to");
    node.op_type == OpType::Cast && to.is_some_and(|to| to.i == DataType::Float as i64)
}

/// Transposes the weights of products, except weights that something else uses too.
fn transpose(graph: &mut Graph<'_>) {
    let mut uses: HashMap<&str, usize> = HashMap::new();
    for name in graph.node.iter().flat_map(|node| &node.input) {
        *uses.entry(name).or_default() += 1;
    }
    let mut weights: HashMap<_, _> = graph
        .initializer
        .iter_mut()
        .map(|tensor| (tensor.name(), tensor))
        .collect();
    let is_product = |node: &&mut Node<'_>| node.op_type == OpType::MatMul && node.domain.is_empty();
    for node in graph.node.iter_mut().filter(is_product) {
        let once = node.input.get(1).filter(|name| uses.get(*name) == Some(&1));
        let Some(tensor) = once.and_then(|name| weights.get_mut(name)) else {
            continue;
        };
        if let Some(transposed) = transposed(tensor) {
            **tensor = transposed;
            node.op_type = OpType::Custom("FusedMatMul");
            node.domain = MICROSOFT;
            node.attribute.push(Attribute {
                name: "transB",
                r#type: AttributeType::Int,
                i: 1,
                ..Attribute::default()
            });
        }
    }
}

/// The transposed matrix; none if the tensor is no matrix of floats.
fn transposed<'a>(matrix: &TensorProto<'a>) -> Option<TensorProto<'a>> {
    let &[rows, columns] = matrix.dims() else {
        return None;
    };
    let values = matrix
        .as_f32()
        .filter(|_| matrix.data_type() == DataType::Float)?;
    let (height, width) = (usize::try_from(rows).ok()?, usize::try_from(columns).ok()?);
    if values.len() != height.checked_mul(width)? {
        return None;
    }
    let places = (0..width).flat_map(|column| (0..height).map(move |row| row * width + column));
    let transposed = places.map(|place| values[place]).collect();
    Some(TensorProto::from_f32(
        matrix.name(),
        vec![columns, rows],
        transposed,
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use onnx_rs::ast::Model;

    /// The numbers 1 to 6 in 16 bits.
    const SIX: [u8; 12] = [0, 0x3c, 0, 0x40, 0, 0x42, 0, 0x44, 0, 0x45, 0, 0x46];

    fn node<'a>(operator: &'a str, inputs: &[&'a str], output: &'a str) -> Node<'a> {
        Node {
            op_type: OpType::from(operator),
            input: inputs.to_vec(),
            output: vec![output],
            ..Node::default()
        }
    }

    fn cast<'a>(from: &'a str, to: &'a str) -> Node<'a> {
        let attribute = Attribute {
            name: "to",
            r#type: AttributeType::Int,
            i: DataType::Float as i64,
            ..Attribute::default()
        };
        Node {
            attribute: vec![attribute],
            ..node("Cast", &[from], to)
        }
    }

    fn file(dims: &[i64], nodes: Vec<Node<'_>>) -> Vec<u8> {
        let weights = TensorProto::from_raw("w16", dims.to_vec(), DataType::Float16, &SIX);
        let graph = Graph {
            name: "a name",
            node: nodes,
            initializer: vec![weights],
            ..Graph::default()
        };
        onnx_rs::encode(&Model {
            graph: Some(graph),
            ..Model::default()
        })
    }

    #[test]
    fn weights_of_a_product_are_transposed_and_in_32_bits() {
        let rewritten = shareable(&file(
            &[2, 3],
            vec![cast("w16", "w"), node("MatMul", &["x", "w"], "y")],
        ));
        let rewritten = rewritten.unwrap();
        let graph = onnx_rs::parse(&rewritten).unwrap().graph.unwrap();
        let [product] = &graph.node[..] else {
            panic!("{:?}", graph.node);
        };
        assert_eq!(
            (product.op_type.as_str(), product.domain),
            ("FusedMatMul", MICROSOFT)
        );
        let [weights] = &graph.initializer[..] else {
            panic!("{:?}", graph.initializer);
        };
        assert_eq!((weights.name(), weights.dims()), ("w", &[3, 2][..]));
        assert_eq!(weights.as_f32().unwrap()[..], [1.0, 4.0, 2.0, 5.0, 3.0, 6.0]);
        assert_eq!(graph.name, "a name");
    }

    #[test]
    fn weights_that_are_used_twice_are_not_transposed() {
        let nodes = vec![
            cast("w16", "w"),
            node("MatMul", &["x", "w"], "y"),
            node("Add", &["y", "w"], "z"),
        ];
        let rewritten = shareable(&file(&[2, 3], nodes)).unwrap();
        let graph = onnx_rs::parse(&rewritten).unwrap().graph.unwrap();
        assert_eq!(graph.node[0].op_type, OpType::MatMul);
        assert_eq!(graph.initializer[0].dims(), [2, 3]);
    }

    #[test]
    fn other_16_bit_weights_stay_as_they_are() {
        let nodes = vec![
            cast("w16", "w"),
            cast("x", "v"),
            node("Gather", &["w16", "w"], "y"),
        ];
        let rewritten = shareable(&file(&[6], nodes)).unwrap();
        let graph = onnx_rs::parse(&rewritten).unwrap().graph.unwrap();
        let mut names: Vec<_> = graph.initializer.iter().map(TensorProto::name).collect();
        names.sort_unstable();
        assert_eq!(names, ["w", "w16"]);
        assert_eq!(graph.node[0].output, ["v"]);
    }

    #[test]
    fn files_that_are_no_model_are_left_alone() {
        assert!(shareable(b"not a model").is_none());
        assert!(shareable(&[]).is_none());
        let nested = Attribute {
            name: "then_branch",
            r#type: AttributeType::Graph,
            g: Some(Box::new(Graph {
                name: "a branch",
                ..Graph::default()
            })),
            ..Attribute::default()
        };
        let nested = Node {
            attribute: vec![nested],
            ..node("If", &["x"], "y")
        };
        assert!(shareable(&file(&[6], vec![nested])).is_none());
    }
}
