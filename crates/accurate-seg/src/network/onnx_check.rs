use std::collections::{HashMap, HashSet};

use bytes::Bytes;
use prost::Message;

use super::ModelError;
use super::onnx_fields::check_field_count;
use super::onnx_proto::{
    FLOAT, FLOAT16, GraphProto, KIND_FLOAT, KIND_INT, KIND_INTS, KIND_STRING, ModelProto,
    TensorProto, ValueInfoProto,
};
use super::onnx_shapes::{Value, infer};

/// What a network must look like from the outside.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Contract<'a> {
    /// Name of the only input, float32 of shape (N, 1, H, W).
    pub input: &'a str,
    /// Name of the only output, float32 of shape (N, classes, H, W).
    pub output: &'a str,
    /// Channels of the output.
    pub classes: u64,
    /// Sides that the network takes are multiples of this, px.
    pub multiple_px: u64,
}

/// What the check has learnt about a network.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NetworkFacts {
    /// Weights in all tensors.
    pub parameters: u64,
    /// Operations.
    pub nodes: usize,
    /// Version of the operator set.
    pub opset: i64,
    /// The only image size it takes, rows and columns, if it takes but one.
    pub fixed_size: Option<[u64; 2]>,
    /// The program that wrote it.
    pub producer: String,
}

/// Operator sets whose operations mean the same to both engines.
const OPSETS: std::ops::RangeInclusive<i64> = 11..=21;
const MAX_RANK: usize = 8;

/// Checks an ONNX network against its contract, before any engine sees it: readable, self-contained,
/// known operations in an order that can run, shapes that work out to the contract's, finite weights.
///
/// # Errors
/// [`ModelError`], naming the node or tensor.
///
/// # Cost
/// One pass over the weights; they are not copied.
pub(super) fn check_network(
    network: &Bytes,
    contract: &Contract<'_>,
) -> Result<NetworkFacts, ModelError> {
    check_field_count(network)?;
    let model = ModelProto::decode(network.clone())
        .map_err(|error| ModelError::NotOnnx { message: error.to_string() })?;
    let opset = opset(&model)?;
    let graph = model
        .graph
        .as_ref()
        .ok_or_else(|| ModelError::NotOnnx { message: "there is no graph".to_owned() })?;
    if !graph.sparse_initializer.is_empty() || !graph.quantization_annotation.is_empty() {
        return Err(ModelError::unsupported("sparse or quantised tensors"));
    }

    let mut values = HashMap::new();
    let mut parameters = 0_u64;
    for tensor in &graph.initializer {
        let value = check_tensor(tensor)?;
        parameters = parameters.saturating_add(value.dims().iter().product());
        define(&mut values, &tensor.name, value)?;
    }
    let fixed_size = check_interface(graph, contract, &values)?;
    // Odd multiples: a network that halves its image once too often fails on them.
    let [rows, columns] = fixed_size.unwrap_or([3 * contract.multiple_px, contract.multiple_px]);
    define(&mut values, contract.input, Value::Activation([1, 1, rows, columns]))?;
    for (index, node) in graph.node.iter().enumerate() {
        check_attributes(node, index)?;
        let output = infer(node, index, &values, rows * columns)?;
        let [name] = node.output.as_slice() else {
            return Err(ModelError::unsupported(format!(
                "node {index} ({}) has {} outputs",
                node.op_type,
                node.output.len()
            )));
        };
        define(&mut values, name, output)?;
    }
    let expected = Value::Activation([1, contract.classes, rows, columns]);
    match values.get(contract.output) {
        Some(found) if *found == expected => {}
        Some(found) => {
            return Err(ModelError::bad_network(format!(
                "output `{}` has the shape {:?} for an image of {rows} x {columns}; expected {:?}",
                contract.output,
                found.dims(),
                expected.dims()
            )));
        }
        None => {
            return Err(ModelError::bad_network(format!(
                "no node makes the output `{}`",
                contract.output
            )));
        }
    }
    Ok(NetworkFacts {
        parameters,
        nodes: graph.node.len(),
        opset,
        fixed_size,
        producer: model.producer_name.clone(),
    })
}

/// Names of the input that is no weight and of the output.
///
/// # Errors
/// [`ModelError::NotOnnx`], [`ModelError::BadNetwork`] unless there is one of each.
pub(super) fn interface_names(network: &Bytes) -> Result<(String, String), ModelError> {
    check_field_count(network)?;
    let model = ModelProto::decode(network.clone())
        .map_err(|error| ModelError::NotOnnx { message: error.to_string() })?;
    let graph = model
        .graph
        .ok_or_else(|| ModelError::NotOnnx { message: "there is no graph".to_owned() })?;
    let weights: HashSet<&str> = graph.initializer.iter().map(|t| t.name.as_str()).collect();
    let mut inputs = graph.input.iter().filter(|i| !weights.contains(i.name.as_str()));
    match (inputs.next(), inputs.next(), graph.output.as_slice()) {
        (Some(input), None, [output]) => Ok((input.name.clone(), output.name.clone())),
        _ => Err(ModelError::bad_network("expected one input and one output")),
    }
}

fn opset(model: &ModelProto) -> Result<i64, ModelError> {
    if !model.functions.is_empty() || !model.training_info.is_empty() {
        return Err(ModelError::unsupported("local functions or training information"));
    }
    match model.opset_import.as_slice() {
        [only] if only.domain.is_empty() || only.domain == "ai.onnx" => {
            if OPSETS.contains(&only.version) {
                Ok(only.version)
            } else {
                Err(ModelError::unsupported(format!(
                    "operator set {}; known are {} to {}",
                    only.version,
                    OPSETS.start(),
                    OPSETS.end()
                )))
            }
        }
        sets => Err(ModelError::unsupported(format!(
            "operator sets {:?}; expected the standard one alone",
            sets.iter().map(|s| s.domain.as_str()).collect::<Vec<_>>()
        ))),
    }
}

fn define(values: &mut HashMap<String, Value>, name: &str, value: Value) -> Result<(), ModelError> {
    if name.is_empty() {
        return Err(ModelError::bad_network("a value has no name"));
    }
    match values.insert(name.to_owned(), value) {
        None => Ok(()),
        Some(_) => Err(ModelError::bad_network(format!("`{name}` is defined twice"))),
    }
}

/// A weight tensor: held in the file, of a known type, complete and finite.
fn check_tensor(tensor: &TensorProto) -> Result<Value, ModelError> {
    let name = &tensor.name;
    if tensor.data_location != 0 || !tensor.external_data.is_empty() {
        return Err(ModelError::unsupported(format!(
            "weights `{name}` lie in another file (external data)"
        )));
    }
    let size = match tensor.data_type {
        FLOAT => 4,
        FLOAT16 => 2,
        other => {
            return Err(ModelError::unsupported(format!(
                "weights `{name}` have element type {other}; known are float32 (1), float16 (10)"
            )));
        }
    };
    if tensor.dims.len() > MAX_RANK {
        return Err(ModelError::unsupported(format!(
            "weights `{name}` have {} dimensions",
            tensor.dims.len()
        )));
    }
    let dims: Option<Vec<u64>> =
        tensor.dims.iter().map(|d| u64::try_from(*d).ok().filter(|d| *d > 0)).collect();
    let elements = dims.as_ref().and_then(|d| d.iter().try_fold(1_u64, |n, d| n.checked_mul(*d)));
    let (Some(dims), Some(elements)) = (dims, elements) else {
        return Err(ModelError::bad_network(format!(
            "weights `{name}` have the shape {:?}",
            tensor.dims
        )));
    };
    let others = [&tensor.int32_data, &tensor.int64_data, &tensor.double_data];
    if tensor.segment.is_some() || others.iter().any(|data| !data.is_empty()) {
        return Err(ModelError::unsupported(format!(
            "weights `{name}` are stored in an unusual way"
        )));
    }
    // Packed floats have the layout of raw data.
    let data = match (tensor.float_data.as_slice(), size) {
        ([], _) => &tensor.raw_data,
        ([packed], 4) if tensor.raw_data.is_empty() => packed,
        _ => {
            return Err(ModelError::bad_network(format!("weights `{name}` are stored twice")));
        }
    };
    if elements.checked_mul(size) != Some(data.len() as u64) {
        return Err(ModelError::bad_network(format!(
            "weights `{name}` of shape {dims:?} have {} bytes",
            data.len()
        )));
    }
    check_finite(name, data, size)?;
    Ok(if size == 4 { Value::Weights(dims) } else { Value::HalfWeights(dims) })
}

fn check_finite(name: &str, data: &[u8], size: u64) -> Result<(), ModelError> {
    // An exponent of ones only is infinite without mantissa, else not a number.
    let found = if size == 4 {
        data.chunks_exact(4)
            .map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]))
            .enumerate()
            .find(|(_, v)| !v.is_finite())
            .map(|(index, v)| (index, v.to_string()))
    } else {
        data.chunks_exact(2)
            .map(|b| u16::from_le_bytes([b[0], b[1]]))
            .enumerate()
            .find(|(_, bits)| bits & 0x7c00 == 0x7c00)
            .map(|(index, bits)| {
                let value = match (bits & 0x03ff, bits >> 15) {
                    (0, 0) => "inf",
                    (0, _) => "-inf",
                    _ => "NaN",
                };
                (index, value.to_owned())
            })
    };
    match found {
        None => Ok(()),
        Some((index, value)) => {
            Err(ModelError::NotFinite { tensor: name.to_owned(), index, value })
        }
    }
}

/// One input, one output, as the contract wants them; the image size if the input has but one.
fn check_interface(
    graph: &GraphProto,
    contract: &Contract<'_>,
    weights: &HashMap<String, Value>,
) -> Result<Option<[u64; 2]>, ModelError> {
    // Old exporters list the weights among the inputs.
    let inputs: Vec<_> = graph.input.iter().filter(|i| !weights.contains_key(&i.name)).collect();
    let ([input], [output]) = (inputs.as_slice(), graph.output.as_slice()) else {
        return Err(ModelError::bad_network(format!(
            "{} inputs and {} outputs; expected one of each",
            inputs.len(),
            graph.output.len()
        )));
    };
    let input = dims_of(input, contract.input)?;
    let output = dims_of(output, contract.output)?;
    let fits = |dim: Option<u64>, wanted: u64| dim.is_none_or(|d| d == wanted);
    if !(fits(input[0], 1) && fits(input[1], 1)) {
        return Err(ModelError::bad_network(format!(
            "input `{}` has the shape {input:?}; expected one image of one channel",
            contract.input
        )));
    }
    if !(fits(output[0], 1) && fits(output[1], contract.classes)) {
        return Err(ModelError::bad_network(format!(
            "output `{}` has the shape {output:?}; expected {} classes",
            contract.output, contract.classes
        )));
    }
    match (input[2], input[3]) {
        (None, None) => Ok(None),
        (Some(rows), Some(columns)) if rows.min(columns) >= 1 => {
            if rows.max(columns) > MAX_SIDE {
                return Err(ModelError::TooLarge {
                    what: "the network's image side, px",
                    found: rows.max(columns),
                    limit: MAX_SIDE,
                });
            }
            Ok(Some([rows, columns]))
        }
        _ => Err(ModelError::unsupported(format!(
            "input `{}` has the shape {input:?}: either both sides are free or none",
            contract.input
        ))),
    }
}

/// Largest side of a network of fixed size, px.
const MAX_SIDE: u64 = 16_384;

/// The four dimensions of a float32 value, `None` where they are free.
fn dims_of(info: &ValueInfoProto, expected: &str) -> Result<[Option<u64>; 4], ModelError> {
    if info.name != expected {
        return Err(ModelError::bad_network(format!(
            "there is `{}` where `{expected}` is expected",
            info.name
        )));
    }
    let tensor = info.value_type.as_ref().and_then(|t| t.tensor_type.as_ref());
    let (Some(tensor), Some(shape)) = (tensor, tensor.and_then(|t| t.shape.as_ref())) else {
        return Err(ModelError::bad_network(format!("`{expected}` has no tensor shape")));
    };
    if tensor.elem_type != FLOAT {
        return Err(ModelError::bad_network(format!(
            "`{expected}` has element type {}; expected float32 (1)",
            tensor.elem_type
        )));
    }
    let dims: Vec<Option<u64>> =
        shape.dim.iter().map(|d| d.dim_value.and_then(|v| u64::try_from(v).ok())).collect();
    <[Option<u64>; 4]>::try_from(dims).map_err(|dims| {
        ModelError::bad_network(format!("`{expected}` has {} dimensions; expected 4", dims.len()))
    })
}

/// Attributes hold numbers and words only: no graphs, no tensors, nothing that stands elsewhere.
fn check_attributes(node: &super::onnx_proto::NodeProto, index: usize) -> Result<(), ModelError> {
    for attribute in &node.attribute {
        let plain = matches!(attribute.kind, KIND_FLOAT | KIND_INT | KIND_STRING | KIND_INTS)
            && attribute.t.is_none()
            && attribute.g.is_none()
            && attribute.sparse_tensor.is_none()
            && attribute.tensors.is_empty()
            && attribute.graphs.is_empty()
            && attribute.sparse_tensors.is_empty()
            && attribute.strings.is_empty()
            && attribute.floats.is_empty()
            && attribute.ref_attr_name.is_empty()
            && attribute.f.is_finite();
        if !plain {
            return Err(ModelError::unsupported(format!(
                "attribute `{}` of node {index} ({})",
                attribute.name, node.op_type
            )));
        }
    }
    let mut names: Vec<&str> = node.attribute.iter().map(|a| a.name.as_str()).collect();
    names.sort_unstable();
    if names.windows(2).any(|w| w[0] == w[1]) {
        return Err(ModelError::bad_network(format!(
            "node {index} ({}) has an attribute twice",
            node.op_type
        )));
    }
    Ok(())
}
